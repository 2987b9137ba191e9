// The viewer of a line, and the start of either.
/** Figures of the cells of a line, over their means, and the arrays that hold them. */
const FIGURES = { "cell length": "jacobian", "∫M of a cell": "share" };

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

    drawStage(stage, { low, high, log }) {
        const { canvas, context, mesh } = stage,
            { lower, extent, stride } = this.data,
            field = this.controls.field.value;
        this.prepare(stage, 0.5);
        const { w, h, left, top, ratio, ink, paper, scale, place } = stage,
            n = mesh.lines[0],
            x = (stage.x = this.values(stage, "x", place));
        const nothing = field === "nothing",
            nodal = this.fields.includes(field);
        const values = nothing ? null : nodal ? this.values(stage, field, place) : this.cellValues(stage, field, place);
        // the curve has room above and below
        const on = log ? Math.log : (v) => v,
            room = 0.06 * (on(high) - on(low)) || 0.5,
            [from, to] = [on(low) - room, on(high) + room];
        const height = (v) => top + h * (1 - (on(v) - from) / (to - from));
        const px = Float64Array.from(x, (v) => left + w / 2 + (v - this.centre[0]) * scale[0]);
        const stepped = !nothing && values.length < n,
            floor = top + h;
        const py = (i) =>
            nothing
                ? top
                : height(stepped ? Math.max(values[Math.max(0, i - 1)], values[Math.min(n - 2, i)]) : values[i]);

        context.fillStyle = paper;
        context.fillRect(0, 0, canvas.width, canvas.height);
        context.save();
        context.beginPath();
        context.rect(left, top, w, h);
        context.clip();
        context.lineJoin = "round";
        const accent = getComputedStyle(this.controls.field).accentColor;
        // from the first to the last cell in sight, with room for marks
        const edge = 5 * ratio,
            seen = (i) => Math.max(px[i], px[i + 1]) > left - edge && Math.min(px[i], px[i + 1]) < left + w + edge;
        let first = 0,
            last = n - 2;
        while (first < last && !seen(first)) first++;
        while (last > first && !seen(last)) last--;
        const visible = Array.from({ length: last + 2 - first }, (_, k) => first + k);
        if (this.controls.lines.checked || nothing) {
            // lines of a crowd of nodes fade, and those within a pixel are drawn once
            Object.assign(context, { strokeStyle: ink, lineWidth: ratio });
            let drawn = -Infinity;
            for (const i of visible) {
                if (Math.abs(px[i] - drawn) < 0.5) continue;
                drawn = px[i];
                const gap =
                    Math.min(Math.abs(px[i] - (px[i - 1] ?? Infinity)), Math.abs((px[i + 1] ?? Infinity) - px[i])) /
                    ratio;
                context.globalAlpha = Math.min(0.45, Math.max(0.08, 0.1 * gap));
                context.beginPath();
                context.moveTo(px[i], floor);
                context.lineTo(px[i], py(i));
                context.stroke();
            }
            context.globalAlpha = 1;
        }
        if (this.controls.cuts.checked) {
            // thin and faint in a crowd: the curve is to be seen
            mesh.cuts[0].forEach((i, c, all) => {
                const near =
                    Math.max(
                        ...[all[c - 1], all[c + 1]].map((other) =>
                            other === undefined ? Infinity : Math.abs(px[other] - px[i]),
                        ),
                    ) / ratio;
                const strength = Math.min(1, Math.max(0.2, near / 12));
                for (const [colour, thick] of [
                    [paper, 4],
                    ["#d55e00", 2],
                ]) {
                    if (colour === paper && strength < 1) continue;
                    Object.assign(context, {
                        strokeStyle: colour,
                        lineWidth: Math.max(0.75, thick * strength) * ratio,
                        globalAlpha: strength,
                    });
                    context.beginPath();
                    context.moveTo(px[i], floor);
                    context.lineTo(px[i], top);
                    context.stroke();
                }
            });
            context.globalAlpha = 1;
        }
        if (!nothing) {
            Object.assign(context, { strokeStyle: accent, fillStyle: accent, lineWidth: 2 * ratio });
            context.beginPath();
            visible.forEach((i, k) => {
                if (!stepped)
                    return k ? context.lineTo(px[i], height(values[i])) : context.moveTo(px[i], height(values[i]));
                if (i + 1 >= n) return;
                if (k) context.lineTo(px[i], height(values[i]));
                else context.moveTo(px[i], height(values[i]));
                context.lineTo(px[i + 1], height(values[i]));
            });
            context.stroke();
            if (!stepped && visible.length * 5 * ratio < w) {
                for (const i of visible) {
                    context.beginPath();
                    context.arc(px[i], height(values[i]), 3 * ratio, 0, 7);
                    context.fill();
                }
            }
        }
        if (this.node) {
            const [i] = this.node;
            for (const [colour, thick] of [
                [paper, 4.5],
                [ink, 2],
            ]) {
                Object.assign(context, { strokeStyle: colour, lineWidth: thick * ratio });
                context.beginPath();
                context.arc(px[i], nothing ? floor - 8 * ratio : py(i), 6 * ratio, 0, 7);
                context.stroke();
            }
        }
        context.restore();

        const [ends, most] = [
            [left, left + w].map((p) => this.physical(stage, [p, 0])[0]),
            Math.max(2, h / ratio / 60),
        ];
        const along = ticks(...ends, Math.max(2, w / ratio / 90)),
            up = nothing ? [] : log ? powers(low, high) : ticks(from, to, most);
        const what = nothing ? "" : field + (up.less ?? "") + (stepped ? ", over the mean" : "");
        this.frame(stage, along, up, height, [`x${along.less}`, what]);
        const when = this.data.clock ? `at ${this.when(stage.t)}, ` : "";
        canvas.setAttribute(
            "aria-label",
            `${nothing ? "the nodes" : `${what} over x`}, ${(n - 1) * stride} cells, ${when}` +
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

(async () => {
    const source = document.getElementById("viewer-data");
    if (!source) return;
    document.getElementById("viewer").classList.add("live");
    const data = JSON.parse(source.textContent);
    const arrays = await Promise.all(data.meshes.map(async (mesh) => unpack(mesh, await inflate(mesh.data))));
    window.viewer = new (data.line ? LineViewer : Viewer)(data, arrays);
})().catch((error) => {
    document.querySelector(".stages").textContent = `The viewer does not work in this browser: ${error.message}`;
});
