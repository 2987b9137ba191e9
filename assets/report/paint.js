/** Fills the cells of a mesh: `px`, `py` are pixels of nodes, `levels` 0 to 255 at nodes or, with `cell`, in cells. */
function paintCells({ out, w, h }, colours, { px, py, levels, cell, n, m }) {
    for (let i = 0, at = 0; i < n - 1; i++) {
        for (let j = 0; j < m - 1; j++, at++) {
            const a = i * m + j,
                b = a + m,
                c = b + 1,
                d = a + 1;
            const [va, vb, vc, vd] = cell
                ? [levels[at], levels[at], levels[at], levels[at]]
                : [levels[a], levels[b], levels[c], levels[d]];
            // prettier-ignore
            quadrilateral(out, w, h, colours, px[a], py[a], va, px[b], py[b], vb, px[c], py[c], vc, px[d], py[d], vd);
        }
    }
}

/** Draws the lines of a mesh, light on dark colours, dark on light ones; they fade where cells are few pixels wide. */
function paintLines({ out, w, h }, { px, py, levels, cell, n, m }, { ratio, dark }) {
    // c is a node of the cell beside
    const segment = (a, b, c, v) => {
        const white = levels ? whiteness(v) : dark ? 1 : 0,
            dx = px[b] - px[a],
            dy = py[b] - py[a];
        const wide = Math.abs(dx * (py[c] - py[a]) - dy * (px[c] - px[a])) / Math.sqrt(dx * dx + dy * dy);
        const strength = Math.min(levels ? 0.55 : 0.8, levels ? 0.08 * (wide / ratio - 1) : 0.25 * wide);
        if (strength <= 0.02) return;
        // where a line is grey, a white one and a black one lie half a pixel apart
        const off = white > 0 && white < 1 ? 0.5 : 0,
            ox = Math.abs(dy) > Math.abs(dx) ? off : 0,
            oy = off - ox;
        const side = (shade, share, o) => {
            if (share <= 0) return;
            // prettier-ignore
            line(out, w, h, px[a] + o * ox, py[a] + o * oy, px[b] + o * ox, py[b] + o * oy, shade, strength * share);
        };
        side(255, white, -1);
        side(0, 1 - white, 1);
    };
    const value = (k, i, j) =>
        !levels ? 0 : cell ? levels[Math.min(i, n - 2) * (m - 1) + Math.min(j, m - 2)] : levels[k];
    for (let i = 0, k = 0; i < n; i++) {
        for (let j = 0; j < m; j++, k++) {
            if (j + 1 < m) segment(k, k + 1, i + 1 < n ? k + m : k - m, value(k, i, j));
            if (i + 1 < n) segment(k, k + m, j + 1 < m ? k + 1 : k - 1, value(k, i, j));
        }
    }
}

/** The cuts between subdomains, each with its neighbours along the same axis; `at` is the place of a node. */
function cutsOf({ cuts, lines: [n, m] }, at) {
    const path = (count, node) => Array.from({ length: count }, (_, k) => at(node(k)));
    const along = [cuts[0].map((i) => path(m, (k) => [i, k])), cuts[1].map((j) => path(n, (k) => [k, j]))];
    return along.flatMap((paths) => paths.map((path, c) => [path, paths[c - 1], paths[c + 1]]));
}

/** Draws cuts, thin where another is near, so that what lies between them can be seen. */
function strokeCuts(context, cuts, core, ratio) {
    context.lineJoin = "round";
    for (const [colour, thick] of [
        ["rgba(0,0,0,.8)", 3.6],
        [core, 2],
    ]) {
        context.strokeStyle = colour;
        for (const cut of cuts) strokeCut(context, cut, thick * ratio, ratio);
    }
}

/** One of them: stretches of the same width are one path. */
function strokeCut(context, [path, before, after], thick, ratio) {
    const width = (k) => {
        const [a, b] = [path[k], path[k + 1] ?? path[k - 1]],
            [ex, ey] = [b[0] - a[0], b[1] - a[1]];
        const beside = ([x, y]) => Math.abs(ex * (y - a[1]) - ey * (x - a[0])) / (Math.hypot(ex, ey) || 1);
        const near = Math.min(...[before, after].filter(Boolean).map((other) => beside(other[k])), Infinity);
        return Math.round(4 * Math.min(1, Math.max(0.25, near / ratio / 14))) / 4;
    };
    for (let k = 1, from = 0; k < path.length; k++) {
        if (k + 1 < path.length && width(k) === width(from)) continue;
        context.lineWidth = thick * width(from);
        context.beginPath();
        for (let j = from; j <= k; j++) j > from ? context.lineTo(...path[j]) : context.moveTo(...path[j]);
        context.stroke();
        from = k;
    }
}
