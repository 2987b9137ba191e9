/**
 * What the viewers of a mesh and of a line share: controls, time, the part of the plane in sight, and the readout. A
 * viewer has methods for what it draws (`drawStage`, `drawBar`), the figures of its cells (`figures`, `cellValues`),
 * what lies under the pointer (`point`), and what is known of a node (`known`).
 */
class Viewer {
    constructor(data, arrays) {
        Object.assign(this, { data, arrays, at: data.meshes[0].times.length - 1, playing: false, zoom: 1, node: null });
        this.controls = Object.fromEntries(
            ["play", "time", "now", "field", "map", "lines", "cuts"].map((id) => [id, document.getElementById(id)]),
        );
        this.whole();
        this.maps = data.maps.map(colourMap);
        this.fields = data.meshes[0].arrays
            .filter(({ name, inside }) => name !== "x" && name !== "y" && !inside)
            .map((array) => array.name);
        const longest = Math.max(...data.extent);
        this.stretch = data.extent.map((length) => Math.max(1, longest / ELONGATED / length) || 1);
        this.stages = data.meshes.map((mesh, m) => stageOf(this, mesh, m));
        document.querySelector(".stages").classList.toggle("pair", this.stages.length > 1);
        this.offer();
        this.listen();
        this.show(this.at);
    }

    /** Fills the lists of fields and colour maps. */
    offer() {
        const { field, map } = this.controls;
        this.maps.forEach(({ name }) => map.add(new Option(name, name)));
        for (const name of [...this.fields, ...this.figures(), "nothing"]) field.add(new Option(symbol(name), name));
        const label = document.getElementById("cuts-label");
        label.querySelector("span").textContent = this.data.between;
        label.hidden = !this.data.meshes.some((mesh) => mesh.cuts.flat().length);
    }

    /** Connects the controls that are on the page: those of time are not, where nothing moves. */
    listen() {
        const draw = () => this.draw();
        for (const id of ["field", "map", "lines", "cuts"]) this.controls[id].addEventListener("change", draw);
        const click = (id, act) => document.getElementById(id).addEventListener("click", act);
        click("in", () => this.scale(1.5));
        click("out", () => this.scale(1 / 1.5));
        click("reset", () => {
            this.whole();
            draw();
        });
        if (this.controls.time) this.listenToTime();
        new ResizeObserver(draw).observe(document.querySelector(".stages"));
        matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    }

    listenToTime() {
        const { play, time } = this.controls;
        time.max = this.last;
        play.addEventListener("click", () => this.play(!this.playing));
        const stopAt = (frame) => {
            this.play(false);
            this.show(Math.round(frame));
        };
        time.addEventListener("input", () => stopAt(time.value));
        time.addEventListener("keydown", (event) => {
            const to = {
                ArrowLeft: this.at - 1,
                ArrowDown: this.at - 1,
                ArrowRight: this.at + 1,
                ArrowUp: this.at + 1,
                Home: 0,
                End: this.last,
            }[event.key];
            if (to === undefined) return;
            event.preventDefault();
            stopAt(to);
        });
    }

    // time

    /** A moment in words, and nothing where there is none. */
    when(t, digits) {
        if (this.data.clock === "iteration") return `iteration ${Math.round(t)}`;
        return this.data.clock && `t = ${moment(digits ? +t.toPrecision(digits) : t)}`;
    }

    get last() {
        return this.data.meshes[0].times.length - 1;
    }

    /** Shows a place between frames; whole numbers are frames of the run. */
    show(at) {
        this.at = Math.min(this.last, Math.max(0, at));
        this.draw();
    }

    play(on) {
        const { play } = this.controls;
        if (!play || on === this.playing) return;
        this.playing = on;
        play.textContent = on ? "Pause" : "Play";
        // nobody can listen as fast as it plays
        this.controls.now.setAttribute("aria-live", on ? "off" : "polite");
        document.querySelector(".readout").setAttribute("aria-live", on ? "off" : "polite");
        if (!on) return this.show(Math.round(this.at));
        if (this.at >= this.last) this.at = 0;
        const speed = this.last / Math.min(20, Math.max(4, this.last / 5)); // frames a second
        let before = null;
        const tick = (now) => {
            if (!this.playing) return;
            this.show(this.at + (before === null ? 0 : (speed * (now - before)) / 1000));
            before = now;
            if (this.at >= this.last) this.play(false);
            else requestAnimationFrame(tick);
        };
        requestAnimationFrame(tick);
    }

    /** Time of the place shown, and its place among the frames of another mesh: while nothing plays, a frame. */
    placeOf(mesh) {
        const ours = this.data.meshes[0].times,
            from = Math.floor(this.at),
            to = Math.min(this.last, from + 1);
        // nothing is between two iterates
        if (this.data.clock === "iteration") return [ours[from], from];
        const t = ours[from] + (ours[to] - ours[from]) * (this.at - from);
        if (mesh === this.data.meshes[0]) return [t, this.at];
        const times = mesh.times,
            after = times.findIndex((other) => other >= t),
            next = after < 0 ? times.length - 1 : after;
        if (next === 0) return [t, 0];
        const place = Math.min(next, next - 1 + (t - times[next - 1]) / (times[next] - times[next - 1]));
        return [t, this.playing ? place : Math.round(place)];
    }

    /** An array of a mesh at a place, between two frames if need be. */
    values(stage, name, place) {
        const frames = this.arrays[stage.m][name],
            from = Math.floor(place),
            part = place - from;
        if (!part) return frames[from];
        const [a, b] = [frames[from], frames[from + 1]];
        const mixed = new Float64Array(a.length);
        for (let k = 0; k < a.length; k++) mixed[k] = a[k] + (b[k] - a[k]) * part;
        return mixed;
    }

    // space

    whole() {
        const { lower, extent } = this.data;
        this.zoom = 1;
        this.centre = [0, 1].map((d) => lower[d] + extent[d] / 2);
    }

    scale(factor, fixed = this.centre) {
        const zoom = Math.min(1e6, Math.max(0.5, this.zoom * factor)),
            real = zoom / this.zoom;
        this.zoom = zoom;
        this.centre = this.centre.map((c, d) => fixed[d] + (c - fixed[d]) / real);
        this.draw();
    }

    pan(stage, dx, dy) {
        this.centre = [this.centre[0] - dx / stage.scale[0], this.centre[1] + dy / stage.scale[1]];
        this.draw();
    }

    physical(stage, [px, py]) {
        const { scale, w, h, left, top } = stage;
        return [this.centre[0] + (px - left - w / 2) / scale[0], this.centre[1] - (py - top - h / 2) / scale[1]];
    }

    /** Copies of a periodic mesh that may be seen. */
    shifts() {
        const { periodic, extent } = this.data,
            reach = periodic.map((wraps) => (wraps ? [-1, 0, 1] : [0]));
        return reach[0].flatMap((i) => reach[1].map((j) => [i * extent[0], j * extent[1]]));
    }

    key(stage, event) {
        const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
        if (way && event.shiftKey)
            this.pan(stage, -0.1 * way[0] * stage.canvas.width, 0.1 * way[1] * stage.canvas.width);
        else if (way) {
            const [n, m] = stage.mesh.lines,
                [i, j] = this.node ?? [n >> 1, m >> 1];
            this.choose(Math.min(n - 1, Math.max(0, i + way[0])), Math.min(m - 1, Math.max(0, j + way[1])));
        } else if (event.key === "+" || event.key === "=") this.scale(1.5);
        else if (event.key === "-") this.scale(1 / 1.5);
        else if (event.key === "0") {
            this.whole();
            this.draw();
        } else if (event.key === " ") this.play(!this.playing);
        else return;
        event.preventDefault();
    }

    // drawing

    draw() {
        const began = performance.now(),
            { field, now, time } = this.controls;
        const range = this.range(field.value);
        this.stages.forEach((stage) => this.drawStage(stage, range));
        this.drawBar(range);
        const [t] = this.placeOf(this.data.meshes[0]);
        if (now) {
            now.textContent = this.when(t, this.playing ? 5 : 0);
            time.value = this.at;
            time.setAttribute("aria-valuetext", now.textContent);
        }
        this.read();
        this.milliseconds = performance.now() - began;
        this.drawn = (this.drawn ?? 0) + 1;
    }

    /** Smallest and largest value over all frames of all meshes; logarithmic where positive values span much. */
    range(field) {
        this.ranges ??= {};
        return (this.ranges[field] ??= this.findRange(field));
    }

    findRange(field) {
        if (field === "nothing") return { low: 0, high: 1, log: false };
        const nodal = this.fields.includes(field);
        let low = Infinity,
            high = -Infinity;
        for (const stage of this.stages) {
            for (let f = 0; f < stage.mesh.times.length; f++) {
                const values = nodal ? this.arrays[stage.m][field][f] : this.cellValues(stage, field, f);
                values.forEach((v) => {
                    if (v < low) low = v;
                    if (v > high) high = v;
                });
            }
        }
        const size = Math.max(Math.abs(low), Math.abs(high));
        if (high - low <= (nodal ? 1e-12 : ROUNDING) * size) low = high = +(0.5 * (low + high)).toPrecision(4);
        return { low, high, log: SKEWED.includes(field) && low > 0 && high > 30 * low };
    }

    /** Makes a canvas as large as it is shown, finds the scales, and writes what is above it. */
    prepare(stage, height) {
        const { canvas } = stage,
            { extent } = this.data,
            ratio = Math.min(2, window.devicePixelRatio || 1);
        const style = getComputedStyle(document.body);
        const [left, right, top, bottom] = [70, 14, 8, 44].map((p) => Math.round(p * ratio));
        const width = Math.max(160, Math.round(canvas.clientWidth * ratio)),
            w = width - left - right,
            h = Math.round(w * height);
        if (canvas.width !== width || canvas.height !== top + h + bottom)
            Object.assign(canvas, { width, height: top + h + bottom });
        canvas.style.height = `${canvas.height / ratio}px`;
        const [ex, ey] = extent.map((length, d) => length * this.stretch[d]),
            fit = this.zoom * Math.min(w / ex, h / ey || Infinity);
        const scale = this.stretch.map((factor) => fit * factor);
        Object.assign(stage, { w, h, left, top, ratio, scale, ink: style.color, paper: style.backgroundColor });
        this.caption(stage);
    }

    /** Finds the place in time of a canvas, and writes it above with the name of the mesh. */
    caption(stage) {
        const { mesh, caption } = stage;
        const [t, place] = this.placeOf(mesh);
        stage.place = place;
        stage.t = Number.isInteger(place) ? mesh.times[place] : t;
        const time = (this.stages.length > 1 || !this.controls.now) && this.when(stage.t).replace(/ /g, "\u00a0"),
            role = stage.m ? "compared with: " : "mesh generator: ";
        caption.textContent = [mesh.name && role + mesh.name, time].filter(Boolean).join(", ");
        caption.hidden = !caption.textContent;
    }

    /** The frame of a canvas, with ticks along x and up, and what the axes are named. */
    frame({ canvas, context, w, h, left, top, ratio, ink, scale }, along, up, height, names) {
        Object.assign(context, {
            strokeStyle: ink,
            fillStyle: ink,
            lineWidth: ratio,
            font: `${12 * ratio}px system-ui, sans-serif`,
        });
        context.strokeRect(left + 0.5, top + 0.5, w - 1, h - 1);
        context.textAlign = "center";
        context.textBaseline = "top";
        for (const [v, text] of along) {
            const p = left + w / 2 + (v - this.centre[0]) * scale[0];
            context.fillRect(p - ratio / 2, top + h, ratio, 4 * ratio);
            // a label that would be cut stays inside
            const half = context.measureText(text).width / 2;
            context.fillText(text, Math.min(canvas.width - half - 1, Math.max(half + 1, p)), top + h + 7 * ratio);
        }
        context.textAlign = "right";
        context.textBaseline = "middle";
        for (const [v, text] of up) {
            const p = height(v);
            context.fillRect(left - 4 * ratio, p - ratio / 2, 4 * ratio, ratio);
            context.fillText(text, left - 7 * ratio, Math.max(7 * ratio, p), left - 26 * ratio);
        }
        context.textAlign = "center";
        context.fillText(names[0], left + w / 2, canvas.height - 8 * ratio);
        context.save();
        context.translate(8 * ratio, top + h / 2);
        if (names[1].length > 1) context.rotate(-Math.PI / 2);
        context.fillText(names[1], 0, 0, h);
        context.restore();
    }

    // reading

    /** Chooses a node, and a cell at it. */
    choose(i, j, cell) {
        const [n, m] = this.stages[0].mesh.lines;
        this.node = [i, j];
        this.cell = cell ?? [Math.min(i, n - 2), Math.min(j, m - 2)];
        this.draw();
    }

    /** Writes what is known at the chosen node, a line a mesh. */
    read() {
        document.querySelector(".readout").replaceChildren(
            ...this.stages.map((stage) => {
                const line = document.createElement("dl");
                if (this.stages.length > 1) line.append(this.entry("mesh", stage.mesh.name.split(",")[0]));
                line.append(...this.known(stage).map(([name, text]) => this.entry(name, this.node ? text() : "–")));
                return line;
            }),
        );
    }

    entry(name, text) {
        const [pair, dt, dd] = ["div", "dt", "dd"].map((tag) => document.createElement(tag));
        dt.textContent = name;
        dd.textContent = text;
        pair.append(dt, dd);
        return pair;
    }
}
