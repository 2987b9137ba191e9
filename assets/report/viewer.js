// The viewer of a mesh, made of what parts.js has.
class Viewer {
    constructor(data, arrays) {
        Object.assign(this, { data, arrays, at: data.meshes[0].times.length - 1, playing: false, zoom: 1, node: null });
        const byId = (id) => document.getElementById(id);
        this.controls = Object.fromEntries(
            ["play", "time", "now", "field", "map", "lines", "cuts"].map((id) => [id, byId(id)]),
        );
        this.whole();
        this.maps = data.maps.map(({ name, colours }) => ({
            name,
            colours: Int32Array.from({ length: 256 }, (_, k) => {
                const c = parseInt(colours.slice(6 * k, 6 * k + 6), 16);
                return -16777216 | ((c & 255) << 16) | (c & 0xff00) | (c >> 16);
            }),
        }));
        this.maps.forEach(({ name }) => this.controls.map.add(new Option(name, name)));
        this.fields = data.meshes[0].arrays
            .filter(({ name, inside }) => name !== "x" && name !== "y" && !inside)
            .map((array) => array.name);
        const longest = Math.max(...data.extent);
        this.stretch = data.extent.map((length) => Math.max(1, longest / ELONGATED / length) || 1);
        for (const name of [...this.fields, ...this.figures(), "nothing"])
            this.controls.field.add(new Option(symbol(name), name));
        this.stages = data.meshes.map((mesh, m) => this.stage(mesh, m));
        document.querySelector(".stages").classList.toggle("pair", this.stages.length > 1);
        byId("cuts-label").querySelector("span").textContent = data.between;
        byId("cuts-label").hidden = !data.meshes.some((mesh) => mesh.cuts.flat().length);

        const draw = () => this.draw();
        for (const id of ["field", "map", "lines", "cuts"]) this.controls[id].addEventListener("change", draw);
        byId("in").addEventListener("click", () => this.scale(1.5));
        byId("out").addEventListener("click", () => this.scale(1 / 1.5));
        byId("reset").addEventListener("click", () => {
            this.whole();
            draw();
        });
        const { play, time } = this.controls;
        if (time) {
            time.max = this.last;
            play.addEventListener("click", () => this.play(!this.playing));
            time.addEventListener("input", () => {
                this.play(false);
                this.show(Math.round(time.value));
            });
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
                this.play(false);
                this.show(Math.round(to));
            });
        }
        new ResizeObserver(draw).observe(document.querySelector(".stages"));
        matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
        this.show(this.at);
    }

    /** Names of what is known of the cells: an unknown may have the same. */
    figures() {
        return ["Q", "Jacobian"].map((name) => (this.fields.includes(name) ? `${name} of cells` : name));
    }

    /** A moment in words, and nothing where there is none. */
    when(t, digits) {
        if (this.data.clock === "iteration") return `iteration ${Math.round(t)}`;
        return this.data.clock && `t = ${moment(digits ? +t.toPrecision(digits) : t)}`;
    }

    get last() {
        return this.data.meshes[0].times.length - 1;
    }

    /** One canvas with what happens on it. */
    stage(mesh, m) {
        const figure = document.createElement("figure"),
            caption = document.createElement("figcaption"),
            canvas = document.createElement("canvas");
        canvas.tabIndex = 0;
        canvas.setAttribute("role", "application");
        canvas.setAttribute("aria-roledescription", "mesh");
        figure.append(caption, canvas);
        document.querySelector(".stages").append(figure);
        const stage = { mesh, m, caption, canvas, context: canvas.getContext("2d"), values: null };
        const place = (event) => {
            const box = canvas.getBoundingClientRect();
            return [
                ((event.clientX - box.left) * canvas.width) / box.width,
                ((event.clientY - box.top) * canvas.height) / box.height,
            ];
        };
        const fingers = new Map();
        canvas.addEventListener("pointerdown", (event) => {
            canvas.setPointerCapture(event.pointerId);
            fingers.set(event.pointerId, place(event));
        });
        for (const end of ["pointerup", "pointercancel"])
            canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
        canvas.addEventListener("pointermove", (event) => {
            const before = fingers.get(event.pointerId),
                now = place(event);
            if (!before) return this.point(stage, now);
            const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
            if (others.length) {
                const [o] = others,
                    distance = (p) => Math.hypot(p[0] - o[0], p[1] - o[1]);
                this.scale(distance(now) / Math.max(1, distance(before)), this.physical(stage, o));
            } else {
                this.pan(stage, now[0] - before[0], now[1] - before[1]);
            }
            fingers.set(event.pointerId, now);
        });
        canvas.addEventListener(
            "wheel",
            (event) => {
                event.preventDefault();
                this.scale(
                    Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 30 : 1)),
                    this.physical(stage, place(event)),
                );
            },
            { passive: false },
        );
        canvas.addEventListener("keydown", (event) => this.key(stage, event));
        return stage;
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

    // time

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

    /** Smallest and largest value over all frames of all meshes; logarithmic where what is positive spans much. */
    range(field) {
        this.ranges ??= {};
        return (this.ranges[field] ??= (() => {
            if (field === "nothing") return { low: 0, high: 1, log: false };
            let low = Infinity,
                high = -Infinity;
            const take = (v) => {
                if (v < low) low = v;
                if (v > high) high = v;
            };
            this.stages.forEach((stage) =>
                stage.mesh.times.forEach((_, f) => {
                    if (this.fields.includes(field)) this.arrays[stage.m][field][f].forEach(take);
                    else this.cellValues(stage, field, f).forEach(take);
                }),
            );
            const size = Math.max(Math.abs(low), Math.abs(high));
            if (high - low <= (this.fields.includes(field) ? 1e-12 : ROUNDING) * size)
                low = high = +(0.5 * (low + high)).toPrecision(4);
            return { low, high, log: SKEWED.includes(field) && low > 0 && high > 30 * low };
        })());
    }

    cellValues(stage, field, place) {
        const [n, m] = stage.mesh.lines,
            x = this.values(stage, "x", place),
            y = this.values(stage, "y", place);
        const uniform = this.uniform(stage),
            out = new Float64Array((n - 1) * (m - 1));
        for (let i = 0, c = 0; i < n - 1; i++) {
            for (let j = 0; j < m - 1; j++, c++)
                out[c] = shape(x, y, i * m + j, m, uniform)[field.startsWith("Q") ? 0 : 1];
        }
        return out;
    }

    /** Area of an equal cell. */
    uniform(stage) {
        const [n, m] = stage.mesh.lines,
            { extent } = this.data;
        return (extent[0] * extent[1]) / ((n - 1) * (m - 1));
    }

    /** Makes a canvas as large as it is shown, finds the scales, and writes what is above it. */
    prepare(stage, height) {
        const { canvas, mesh } = stage,
            { extent } = this.data,
            ratio = Math.min(2, window.devicePixelRatio || 1);
        const style = getComputedStyle(document.body),
            ink = style.color,
            paper = style.backgroundColor;
        const [left, right, top, bottom] = [70, 14, 8, 44].map((p) => Math.round(p * ratio));
        const width = Math.max(160, Math.round(canvas.clientWidth * ratio)),
            w = width - left - right,
            h = Math.round(w * height);
        if (canvas.width !== width || canvas.height !== top + h + bottom)
            Object.assign(canvas, { width, height: top + h + bottom });
        canvas.style.height = `${canvas.height / ratio}px`;
        const [ex, ey] = extent.map((length, d) => length * this.stretch[d]),
            fit = this.zoom * Math.min(w / ex, h / ey || Infinity);
        Object.assign(stage, { w, h, left, top, ratio, ink, paper, scale: this.stretch.map((factor) => fit * factor) });
        const [t, place] = this.placeOf(mesh);
        stage.place = place;
        stage.t = Number.isInteger(place) ? mesh.times[place] : t;
        const pair = (this.stages.length > 1 || !this.controls.now) && this.when(stage.t).replace(/ /g, "\u00a0"),
            role = stage.m ? "compared with: " : "mesh generator: ";
        stage.caption.textContent = [mesh.name && role + mesh.name, pair].filter(Boolean).join(", ");
        stage.caption.hidden = !stage.caption.textContent;
    }

    drawStage(stage, { low, high, log }) {
        const { canvas, context, mesh } = stage,
            { extent } = this.data;
        this.prepare(
            stage,
            Math.min(1.25, Math.max(1 / ELONGATED, (extent[1] * this.stretch[1]) / (extent[0] * this.stretch[0]))),
        );
        const { w, h, left, top, ratio, paper, scale, place } = stage;
        const field = this.controls.field.value,
            [n, m] = mesh.lines,
            nodes = n * m;
        const x = this.values(stage, "x", place),
            y = this.values(stage, "y", place);
        const level = log
            ? (v) => (255.99 * Math.log(v / low)) / Math.log(high / low)
            : (v) => (high > low ? (255.99 * (v - low)) / (high - low) : 128);
        const nodal = this.fields.includes(field),
            cell = !nodal && field !== "nothing";
        const levels =
            nodal || cell
                ? (nodal ? this.values(stage, field, place) : this.cellValues(stage, field, place)).map(level)
                : null;
        Object.assign(stage, { x, y });

        const image = this.blank(stage);
        const surface = { out: new Int32Array(image.data.buffer), w, h };
        const px = new Float64Array(nodes),
            py = new Float64Array(nodes);
        const shown = { px, py, levels, cell, n, m };
        const cuts = [];
        for (const shift of this.shifts()) {
            for (let k = 0; k < nodes; k++) {
                px[k] = w / 2 + (x[k] + shift[0] - this.centre[0]) * scale[0];
                py[k] = h / 2 - (y[k] + shift[1] - this.centre[1]) * scale[1];
            }
            if (levels) paintCells(surface, this.colours(), shown);
            if (this.controls.lines.checked || field === "nothing") paintLines(surface, shown, stage);
            if (this.controls.cuts.checked)
                cuts.push(...cutsOf(mesh, ([i, j]) => [left + px[i * m + j], top + py[i * m + j]]));
        }
        context.fillStyle = paper;
        context.clearRect(0, 0, canvas.width, canvas.height);
        context.putImageData(image, left, top);

        context.save();
        context.beginPath();
        context.rect(left, top, w, h);
        context.clip();
        // told from mesh lines, also where there is no colour below
        const core = this.data.between === "front" ? "#f28e2b" : levels ? "#fff" : "#2a8fd0";
        strokeCuts(context, cuts, core, ratio);
        if (this.node) this.mark(stage, this.node[0] * m + this.node[1]);
        context.restore();
        this.label(stage);
    }

    /** The image of a canvas, in the colour of the page. */
    blank(stage) {
        const { w, h, paper, context } = stage;
        if (stage.image?.width !== w || stage.image?.height !== h) stage.image = context.createImageData(w, h);
        const [r, g, b] = paper.match(/\d+/g).map(Number);
        new Int32Array(stage.image.data.buffer).fill(-16777216 | (b << 16) | (g << 8) | r);
        stage.dark = r + g + b < 384;
        return stage.image;
    }

    /** The colour map that is chosen. */
    colours() {
        return (this.maps.find((map) => map.name === this.controls.map.value) ?? this.maps[0]).colours;
    }

    /** Rings the node that is chosen, and its periodic images. */
    mark({ context, x, y, left, top, w, h, ratio, scale }, k) {
        for (const [colour, thick] of [
            ["#000", 4.5],
            ["#fff", 2],
        ]) {
            Object.assign(context, { strokeStyle: colour, lineWidth: thick * ratio });
            for (const [sx, sy] of this.shifts()) {
                const across = left + w / 2 + (x[k] + sx - this.centre[0]) * scale[0];
                const up = top + h / 2 - (y[k] + sy - this.centre[1]) * scale[1];
                context.beginPath();
                context.arc(across, up, 6 * ratio, 0, 7);
                context.stroke();
            }
        }
    }

    /** Draws the frame with its ticks, and says to those who cannot see it what the canvas shows. */
    label(stage) {
        const { canvas, mesh, w, h, left, top, ratio, scale } = stage,
            field = this.controls.field.value,
            [n, m] = mesh.lines;
        const [from, to] = [this.physical(stage, [left, top + h]), this.physical(stage, [left + w, top])];
        const along = ticks(from[0], to[0], Math.max(2, w / ratio / 90)),
            up = ticks(from[1], to[1], Math.max(2, h / ratio / 60));
        const names = ["x", "y"].map(
            (name, d) =>
                name +
                [along, up][d].less +
                (this.stretch[d] > 1 ? `, stretched ${number(this.stretch[d], 3)} times` : ""),
        );
        this.frame(stage, along, up, (v) => top + h / 2 - (v - this.centre[1]) * scale[1], names);
        const what = field === "nothing" ? "the mesh" : `the mesh over ${symbol(field)}`;
        const { stride } = this.data;
        const lattice = `${(n - 1) * stride} by ${(m - 1) * stride} cells`;
        const when = this.data.clock ? `at ${this.when(stage.t)}, ` : "";
        const where = `from x = ${moment(from[0])} to ${moment(to[0])} and y = ${moment(from[1])} to ${moment(to[1])}`;
        canvas.setAttribute("aria-label", `${mesh.name && `${mesh.name}: `}${what}, ${lattice}, ${when}${where}`);
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

    drawBar({ low, high, log }) {
        const bar = document.querySelector(".bar"),
            canvas = bar.querySelector("canvas"),
            field = this.controls.field.value;
        bar.style.visibility = field === "nothing" ? "hidden" : "";
        canvas.width = 256;
        const context = canvas.getContext("2d"),
            image = context.createImageData(256, 14),
            out = new Int32Array(image.data.buffer);
        const colours = this.colours();
        for (let k = 0; k < out.length; k++) out[k] = colours[k % 256];
        context.putImageData(image, 0, 0);
        const place = (v) =>
            log ? Math.log(v / low) / Math.log(high / low) : high > low ? (v - low) / (high - low) : 0.5;
        const labels = log ? powers(low, high) : ticks(low, high, Math.max(2, Math.min(6, canvas.clientWidth / 70)));
        bar.querySelector(".name").textContent = symbol(field) + (log ? " (log)" : labels.less);
        bar.querySelector(".ticks").replaceChildren(
            ...labels.map(([v, text]) => {
                const label = document.createElement("span");
                label.textContent = text;
                label.style.left = `${100 * place(v)}%`;
                return label;
            }),
        );
    }

    // reading

    /** The cell under a place on the canvas, if there is one. */
    cellAt(stage, place) {
        const [px, py] = this.physical(stage, place),
            { x, y, mesh } = stage,
            [n, m] = mesh.lines;
        for (const shift of this.shifts()) {
            const u = px - shift[0],
                v = py - shift[1];
            for (let i = 0; i < n - 1; i++) {
                for (let j = 0; j < m - 1; j++) {
                    const a = i * m + j,
                        corners = [a, a + m, a + m + 1, a + 1];
                    if (
                        corners.every((k) => x[k] < u) ||
                        corners.every((k) => x[k] > u) ||
                        corners.every((k) => y[k] < v) ||
                        corners.every((k) => y[k] > v)
                    )
                        continue;
                    const inside = corners.every((k, c) => {
                        const next = corners[(c + 1) % 4];
                        return (x[next] - x[k]) * (v - y[k]) - (y[next] - y[k]) * (u - x[k]) >= 0;
                    });
                    if (inside) {
                        const distance = (k) => Math.hypot(x[k] - u, y[k] - v);
                        return {
                            cell: [i, j],
                            node: corners.reduce((best, k) => (distance(k) < distance(best) ? k : best)),
                        };
                    }
                }
            }
        }
        return null;
    }

    point(stage, place) {
        const found = this.cellAt(stage, place);
        if (!found) return;
        const m = stage.mesh.lines[1];
        this.choose(Math.floor(found.node / m), found.node % m, found.cell);
    }

    /** Chooses a node, and a cell at it. */
    choose(i, j, cell) {
        const [n, m] = this.stages[0].mesh.lines;
        this.node = [i, j];
        this.cell = cell ?? [Math.min(i, n - 2), Math.min(j, m - 2)];
        this.draw();
    }

    /** Digits that figures of the chosen cell have, whose corners stand on levels: few where it is thin. */
    digits({ x, y, mesh, ...stage }, levels, jacobian) {
        const m = mesh.lines[1],
            a = this.cell[0] * m + this.cell[1],
            [b, c, d] = [a + m, a + m + 1, a + 1];
        const grain = Math.max(...["x", "y"].map((name) => levels[name].high - levels[name].low)) / 0xffffff;
        const longest = Math.max(
            ...[
                [a, b],
                [b, c],
                [c, d],
                [d, a],
            ].map(([p, q]) => Math.hypot(x[p] - x[q], y[p] - y[q])),
        );
        const width = (Math.abs(jacobian) * this.uniform({ mesh, ...stage })) / longest;
        return Math.min(6, Math.max(2, Math.floor(-Math.log10((4 * grain) / width)))) || 2;
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

    /** Names and texts of what is known at the chosen node. */
    known(stage) {
        const m = stage.mesh.lines[1],
            { stride, cells } = this.data,
            k = this.node && this.node[0] * m + this.node[1];
        const levels = Object.fromEntries(stage.mesh.arrays.map((array) => [array.name, array]));
        const figures = this.node && shape(stage.x, stage.y, this.cell[0] * m + this.cell[1], m, this.uniform(stage));
        const digits = this.node && this.digits(stage, levels, figures[1]);
        return [
            ["node", () => `(${this.node.map((index, d) => Math.min(index * stride, cells[d])).join(", ")})`],
            ...["x", "y"].map((name) => [name, () => reading(stage[name][k], levels[name])]),
            ...this.fields.map((name) => [
                symbol(name),
                () => reading(this.values(stage, name, stage.place)[k], levels[name]),
            ]),
            ["Q of the cell", () => number(figures[0], digits)],
            ["its Jacobian", () => number(figures[1], digits)],
        ];
    }
}
