// The viewer of a mesh of quadrilaterals.

/** Whether a quadrilateral, by the nodes at its corners, holds a point. */
function holds({ x, y }, corners, u, v) {
    const apart =
        corners.every((k) => x[k] < u) ||
        corners.every((k) => x[k] > u) ||
        corners.every((k) => y[k] < v) ||
        corners.every((k) => y[k] > v);
    if (apart) return false;
    return corners.every((k, c) => {
        const next = corners[(c + 1) % 4];
        return (x[next] - x[k]) * (v - y[k]) - (y[next] - y[k]) * (u - x[k]) >= 0;
    });
}

/** A mesh over the colours of a field, with its lines and the cuts between its subdomains. */
class MeshViewer extends Viewer {
    /** Names of what is known of the cells: an unknown may have the same. */
    figures() {
        return ["Q", "Jacobian"].map((name) => (this.fields.includes(name) ? `${name} of cells` : name));
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

    // drawing

    drawStage(stage, range) {
        const { canvas, context } = stage,
            { extent } = this.data;
        const height = (extent[1] * this.stretch[1]) / (extent[0] * this.stretch[0]);
        this.prepare(stage, Math.min(1.25, Math.max(1 / ELONGATED, height)));
        const { w, h, left, top, ratio, paper, place } = stage;
        Object.assign(stage, { x: this.values(stage, "x", place), y: this.values(stage, "y", place) });
        const levels = this.levels(stage, range),
            image = this.blank(stage),
            cuts = this.paint(stage, image, levels);
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
        if (this.node) this.mark(stage, this.node[0] * stage.mesh.lines[1] + this.node[1]);
        context.restore();
        this.label(stage);
    }

    /** Places on the colour map, 0 to 255, of the values at nodes or in cells; nothing where no field is chosen. */
    levels(stage, { low, high, log }) {
        const field = this.controls.field.value;
        if (field === "nothing") return null;
        const nodal = this.fields.includes(field);
        const values = nodal ? this.values(stage, field, stage.place) : this.cellValues(stage, field, stage.place);
        if (log) return values.map((v) => (255.99 * Math.log(v / low)) / Math.log(high / low));
        return values.map((v) => (high > low ? (255.99 * (v - low)) / (high - low) : 128));
    }

    /** Paints cells and lines with their periodic copies into an image, and gives the cuts that are to be drawn. */
    paint(stage, image, levels) {
        const { mesh, x, y, w, h, left, top, scale } = stage,
            [n, m] = mesh.lines,
            field = this.controls.field.value,
            [px, py] = [new Float64Array(n * m), new Float64Array(n * m)];
        const surface = { out: new Int32Array(image.data.buffer), w, h };
        const shown = { px, py, levels, cell: !this.fields.includes(field), n, m };
        const cuts = [];
        for (const shift of this.shifts()) {
            for (let k = 0; k < n * m; k++) {
                px[k] = w / 2 + (x[k] + shift[0] - this.centre[0]) * scale[0];
                py[k] = h / 2 - (y[k] + shift[1] - this.centre[1]) * scale[1];
            }
            if (levels) paintCells(surface, this.colours(), shown);
            if (this.controls.lines.checked || field === "nothing") paintLines(surface, shown, stage);
            if (this.controls.cuts.checked)
                cuts.push(...cutsOf(mesh, ([i, j]) => [left + px[i * m + j], top + py[i * m + j]]));
        }
        return cuts;
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

    /** The cell under a place on the canvas and its nearest node, if there is one. */
    cellAt(stage, place) {
        const [px, py] = this.physical(stage, place),
            [n, m] = stage.mesh.lines;
        for (const [sx, sy] of this.shifts()) {
            const [u, v] = [px - sx, py - sy];
            for (let i = 0; i < n - 1; i++) {
                for (let j = 0; j < m - 1; j++) {
                    const a = i * m + j,
                        corners = [a, a + m, a + m + 1, a + 1];
                    if (!holds(stage, corners, u, v)) continue;
                    const distance = (k) => Math.hypot(stage.x[k] - u, stage.y[k] - v);
                    return {
                        cell: [i, j],
                        node: corners.reduce((best, k) => (distance(k) < distance(best) ? k : best)),
                    };
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
