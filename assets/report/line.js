// The viewer of a line.

/** Figures of the cells of a line, over their means, and the arrays that hold them. */
const FIGURES = { "cell length": "jacobian", "∫M of a cell": "share" };

/** Strokes an upright line. */
function strokeBetween(context, x, from, to) {
    context.beginPath();
    context.moveTo(x, from);
    context.lineTo(x, to);
    context.stroke();
}

/** Of a line: a curve over x through all nodes, which stand under it. */
class LineViewer extends Viewer {
    figures() {
        return [...Object.keys(FIGURES).filter((name) => this.arrays[0][FIGURES[name]]), "ξ"];
    }

    /** Values in the cells, of what is no field of the nodes; ξ at the nodes. */
    cellValues(stage, field, place) {
        const n = stage.mesh.lines[0];
        return field === "ξ"
            ? Float64Array.from({ length: n }, (_, i) => i / (n - 1))
            : this.values(stage, FIGURES[field], place).subarray(0, n - 1);
    }

    drawBar() {
        document.querySelector(".bar").hidden = true;
    }

    drawStage(stage, range) {
        this.prepare(stage, 0.5);
        const { canvas, context, left, top, w, h, paper } = stage;
        stage.x = this.values(stage, "x", stage.place);
        const curve = this.curve(stage, range);
        context.fillStyle = paper;
        context.fillRect(0, 0, canvas.width, canvas.height);
        context.save();
        context.beginPath();
        context.rect(left, top, w, h);
        context.clip();
        context.lineJoin = "round";
        if (this.controls.lines.checked || !curve.values) this.drawNodes(stage, curve);
        if (this.controls.cuts.checked) this.drawCuts(stage, curve);
        if (curve.values) this.drawCurve(stage, curve);
        if (this.node) this.mark(stage, curve);
        context.restore();
        this.label(stage, range, curve);
    }

    /**
     * The curve of the field that is chosen, in pixels: `px` of the nodes, the `height` of a value, the top `py` of a
     * node's line, and the nodes in sight. `stepped` curves have one value a cell.
     */
    curve(stage, { low, high, log }) {
        const { mesh, x, w, h, left, top, ratio, scale, place } = stage,
            field = this.controls.field.value,
            n = mesh.lines[0];
        const px = Float64Array.from(x, (v) => left + w / 2 + (v - this.centre[0]) * scale[0]);
        // from the first to the last cell in sight, with room for marks
        const edge = 5 * ratio,
            seen = (i) => Math.max(px[i], px[i + 1]) > left - edge && Math.min(px[i], px[i + 1]) < left + w + edge;
        let first = 0,
            last = n - 2;
        while (first < last && !seen(first)) first++;
        while (last > first && !seen(last)) last--;
        const visible = Array.from({ length: last + 2 - first }, (_, k) => first + k);
        // the curve has room above and below
        const on = log ? Math.log : (v) => v,
            room = 0.06 * (on(high) - on(low)) || 0.5,
            [from, to] = [on(low) - room, on(high) + room];
        const height = (v) => top + h * (1 - (on(v) - from) / (to - from));
        const shown = { n, px, visible, height, from, to };
        if (field === "nothing") return { ...shown, values: null, stepped: false, py: () => top };
        const nodal = this.fields.includes(field);
        const values = nodal ? this.values(stage, field, place) : this.cellValues(stage, field, place),
            stepped = values.length < n;
        const beside = (i) => Math.max(values[Math.max(0, i - 1)], values[Math.min(n - 2, i)]);
        return { ...shown, values, stepped, py: (i) => height(stepped ? beside(i) : values[i]) };
    }

    /** A line under every node: in a crowd they fade, and those within half a pixel are drawn once. */
    drawNodes({ context, ink, ratio, top, h }, { px, py, visible }) {
        Object.assign(context, { strokeStyle: ink, lineWidth: ratio });
        let drawn = -Infinity;
        for (const i of visible) {
            if (Math.abs(px[i] - drawn) < 0.5) continue;
            drawn = px[i];
            const before = Math.abs(px[i] - (px[i - 1] ?? Infinity)),
                after = Math.abs((px[i + 1] ?? Infinity) - px[i]);
            context.globalAlpha = Math.min(0.45, Math.max(0.08, (0.1 * Math.min(before, after)) / ratio));
            strokeBetween(context, px[i], top + h, py(i));
        }
        context.globalAlpha = 1;
    }

    /** The ends of subdomains: in a crowd thin and faint, for the curve is to be seen. */
    drawCuts({ context, mesh, paper, ratio, top, h }, { px }) {
        mesh.cuts[0].forEach((i, c, all) => {
            const gap = (other) => (other === undefined ? Infinity : Math.abs(px[other] - px[i]));
            const near = Math.max(gap(all[c - 1]), gap(all[c + 1])) / ratio;
            const strength = Math.min(1, Math.max(0.2, near / 12));
            for (const [colour, thick] of [
                [paper, 4],
                ["#d55e00", 2],
            ]) {
                if (colour === paper && strength < 1) continue;
                const lineWidth = Math.max(0.75, thick * strength) * ratio;
                Object.assign(context, { strokeStyle: colour, lineWidth, globalAlpha: strength });
                strokeBetween(context, px[i], top + h, top);
            }
        });
        context.globalAlpha = 1;
    }

    /** The curve, with dots at the nodes where they are few. */
    drawCurve({ context, ratio, w }, { n, px, visible, height, values, stepped }) {
        const accent = getComputedStyle(this.controls.field).accentColor;
        Object.assign(context, { strokeStyle: accent, fillStyle: accent, lineWidth: 2 * ratio });
        context.beginPath();
        visible.forEach((i, k) => {
            if (stepped && i + 1 >= n) return;
            if (k) context.lineTo(px[i], height(values[i]));
            else context.moveTo(px[i], height(values[i]));
            if (stepped) context.lineTo(px[i + 1], height(values[i]));
        });
        context.stroke();
        if (stepped || visible.length * 5 * ratio >= w) return;
        for (const i of visible) {
            context.beginPath();
            context.arc(px[i], height(values[i]), 3 * ratio, 0, 7);
            context.fill();
        }
    }

    /** Rings the node that is chosen. */
    mark({ context, paper, ink, ratio, top, h }, { px, py, values }) {
        const [i] = this.node;
        for (const [colour, thick] of [
            [paper, 4.5],
            [ink, 2],
        ]) {
            Object.assign(context, { strokeStyle: colour, lineWidth: thick * ratio });
            context.beginPath();
            context.arc(px[i], values ? py(i) : top + h - 8 * ratio, 6 * ratio, 0, 7);
            context.stroke();
        }
    }

    /** Draws the frame with its ticks, and says to those who cannot see it what the canvas shows. */
    label(stage, { low, high, log }, { n, values, stepped, height, from, to }) {
        const { canvas, w, h, left, ratio } = stage,
            field = this.controls.field.value;
        const ends = [left, left + w].map((p) => this.physical(stage, [p, 0])[0]);
        const along = ticks(...ends, Math.max(2, w / ratio / 90)),
            most = Math.max(2, h / ratio / 60),
            up = !values ? [] : log ? powers(low, high) : ticks(from, to, most);
        const what = values ? field + (up.less ?? "") + (stepped ? ", over the mean" : "") : "";
        this.frame(stage, along, up, height, [`x${along.less}`, what]);
        const when = this.data.clock ? `at ${this.when(stage.t)}, ` : "";
        canvas.setAttribute(
            "aria-label",
            `${values ? `${what} over x` : "the nodes"}, ${(n - 1) * this.data.stride} cells, ${when}` +
                `from x = ${moment(ends[0])} to ${moment(ends[1])}`,
        );
    }

    pan(stage, dx) {
        super.pan(stage, dx, 0);
    }

    point(stage, [px]) {
        const wanted = this.physical(stage, [px, 0])[0],
            { x } = stage;
        let best = 0;
        for (let i = 1; i < x.length; i++) if (Math.abs(x[i] - wanted) < Math.abs(x[best] - wanted)) best = i;
        this.choose(best, 0);
    }

    known(stage) {
        const [i] = this.node ?? [0],
            n = stage.x.length,
            levels = Object.fromEntries(stage.mesh.arrays.map((array) => [array.name, array]));
        const node = Math.min(i * this.data.stride, this.data.cells[0]),
            figures = this.figures().filter((name) => name !== "ξ");
        return [
            ["node", () => String(node)],
            ["x", () => reading(stage.x[i], levels.x)],
            ["ξ", () => number(node / this.data.cells[0])],
            ...this.fields.map((name) => [name, () => reading(this.values(stage, name, stage.place)[i], levels[name])]),
            ...figures.map((name) => [
                `${name}, over the mean`,
                () =>
                    number(
                        rounded(this.cellValues(stage, name, stage.place)[Math.min(i, n - 2)], levels[FIGURES[name]]),
                    ),
            ]),
        ];
    }
}
