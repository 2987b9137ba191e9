"use strict";
// Light, dark, or as the system says.
document.getElementById("theme").addEventListener("click", () => {
    const root = document.documentElement;
    const dark = root.style.colorScheme
        ? root.style.colorScheme === "dark"
        : matchMedia("(prefers-color-scheme: dark)").matches;
    root.style.colorScheme = dark ? "light" : "dark";
    root.classList.toggle("dark", !dark);
    root.classList.toggle("light", dark);
    window.viewer?.draw();
});

// ---- data ----

/** Bytes of zlib data in base64. */
async function inflate(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Arrays of a mesh by name, one Float64Array a frame: differences of 24-bit levels, added up again. */
function unpack(mesh, bytes) {
    const nodes = mesh.lines[0] * mesh.lines[1],
        all = nodes * mesh.times.length,
        levels = new Int32Array(all);
    const found = {};
    mesh.arrays.forEach(({ name, low, high }, a) => {
        const start = 3 * all * a;
        for (let k = 0; k < all; k++) {
            const difference = bytes[start + k] | (bytes[start + all + k] << 8) | (bytes[start + 2 * all + k] << 16);
            const left = k % nodes ? levels[k - 1] - (k >= nodes ? levels[k - nodes - 1] : 0) : 0;
            levels[k] = (difference + left + (k >= nodes ? levels[k - nodes] : 0)) & 0xffffff;
        }
        const value = (n) => low + (high / 0xffffff - low / 0xffffff) * n;
        found[name] = mesh.times.map((_, f) => Float64Array.from(levels.subarray(f * nodes, (f + 1) * nodes), value));
    });
    return found;
}

/** Q and the smallest corner Jacobian of the cell between nodes a and c, from positions. */
function shape(x, y, a, row, uniform) {
    const b = a + row,
        c = b + 1,
        d = a + 1;
    const ex = (x[b] - x[a] + x[c] - x[d]) / 2,
        ey = (y[b] - y[a] + y[c] - y[d]) / 2;
    const fx = (x[d] - x[a] + x[c] - x[b]) / 2,
        fy = (y[d] - y[a] + y[c] - y[b]) / 2;
    const q = (ex * ex + ey * ey + fx * fx + fy * fy) / 2 / Math.abs(ex * fy - ey * fx);
    const corner = (p, r, s) => (x[r] - x[p]) * (y[s] - y[p]) - (y[r] - y[p]) * (x[s] - x[p]);
    const j = Math.min(corner(a, b, d), corner(b, c, a), corner(c, d, b), corner(d, a, c));
    return [q, j / uniform];
}

// ---- pixels ----

/** Where a row of pixels enters and leaves a quadrilateral, and the values there; filled anew for each row. */
const span = { from: 0, to: 0, first: 0, last: 0 };

/** Takes the place where an edge crosses the middle of a row, if it does; `per` is 1 over its height. */
function cross(y, ax, ay, av, bx, by, bv, per) {
    if (ay <= y === by <= y) return;
    const s = (y - ay) * per,
        x = ax + s * (bx - ax);
    if (x < span.from) {
        span.from = x;
        span.first = av + s * (bv - av);
    }
    if (x > span.to) {
        span.to = x;
        span.last = av + s * (bv - av);
    }
}

/**
 * Fills a quadrilateral, between its leftmost and rightmost point in every row, with colours between the values
 * (0 to 255) there.
 */
function quadrilateral(out, w, h, colours, ax, ay, av, bx, by, bv, cx, cy, cv, dx, dy, dv) {
    const low = Math.min(ay, by, cy, dy),
        high = Math.max(ay, by, cy, dy),
        top = Math.max(0, Math.ceil(low - 0.5)),
        bottom = Math.min(h - 1, Math.floor(high - 0.5));
    if (top > bottom) return;
    const ab = 1 / (by - ay),
        bc = 1 / (cy - by),
        cd = 1 / (dy - cy),
        da = 1 / (ay - dy);
    for (let j = top; j <= bottom; j++) {
        const y = j + 0.5;
        span.from = Infinity;
        span.to = -Infinity;
        cross(y, ax, ay, av, bx, by, bv, ab);
        cross(y, bx, by, bv, cx, cy, cv, bc);
        cross(y, cx, cy, cv, dx, dy, dv, cd);
        cross(y, dx, dy, dv, ax, ay, av, da);
        if (span.to >= 0 && span.from <= w) fillRow(out, w, j, colours);
    }
}

/** Fills a row of pixels in the span. */
function fillRow(out, w, j, colours) {
    const { from, to } = span;
    const first = Math.max(0, Math.ceil(from - 0.5)),
        last = j * w + Math.min(w - 1, Math.ceil(to - 0.5) - 1);
    const slope = to > from ? (span.last - span.first) / (to - from) : 0;
    let v = span.first + slope * (first + 0.5 - from);
    for (let k = j * w + first; k <= last; k++, v += slope) out[k] = colours[v < 0 ? 0 : v > 255 ? 255 : v | 0];
}

/**
 * Share of white in lines over a colour of the map: they are white on dark colours, black on light ones, and where
 * neither stands out a white one beside a black one; a jump would look like a line of its own.
 */
function whiteness(v) {
    return v < 90 ? 1 : v > 166 ? 0 : (166 - v) / 76;
}

/** Mixes a share (of 256) of black or white (0 or 255) into a pixel. */
function mix(pixel, shade, share) {
    const r = pixel & 255,
        g = (pixel >> 8) & 255,
        b = (pixel >> 16) & 255;
    return (
        -16777216 |
        ((b + (((shade - b) * share) >> 8)) << 16) |
        ((g + (((shade - g) * share) >> 8)) << 8) |
        (r + (((shade - r) * share) >> 8))
    );
}

/** Mixes black or white (0 or 255) into a line of pixels, after Wu. */
function line(out, w, h, x0, y0, x1, y1, shade, strength) {
    if (Math.abs(y1 - y0) > Math.abs(x1 - x0)) along(out, h, w, w, 1, y0, x0, y1, x1, shade, strength);
    else along(out, w, h, 1, w, x0, y0, x1, y1, shade, strength);
}

/** A line that goes farther along the first of its axes (so many pixels, `step` apart) than along the other. */
function along(out, count, across, step, other, x0, y0, x1, y1, shade, strength) {
    const slope = x1 === x0 ? 0 : (y1 - y0) / (x1 - x0),
        from = x0 < x1 ? x0 : x1,
        to = x0 < x1 ? x1 : x0;
    const first = Math.max(0, Math.round(from)),
        last = Math.min(count - 1, Math.round(to) - 1);
    let y = y0 - 0.5 + slope * (first + 0.5 - x0);
    for (let i = first; i <= last; i++, y += slope) {
        const low = Math.floor(y),
            part = (y - low) * strength * 256,
            k = i * step + low * other;
        if (low >= 0 && low < across) out[k] = mix(out[k], shade, (strength * 256 - part) | 0);
        if (low + 1 >= 0 && low + 1 < across) out[k + other] = mix(out[k + other], shade, part | 0);
    }
}

// ---- words ----

const SYMBOLS = { rho: "ρ", "mesh density": "mesh density ρ" };
/** What is positive and may span much. */
const SKEWED = ["rho", "M", "mesh density", "Q", "Jacobian", "Q of cells", "Jacobian of cells"];
/** Of the range of Q and the Jacobian, which come from rounded positions, what may be rounding alone. */
const ROUNDING = 1e-4;
const symbol = (name) => SYMBOLS[name] ?? name;

/** Six digits, as a power of ten where that is shorter. */
function number(v, digits = 6) {
    const size = Math.abs(v);
    const text =
        v === 0
            ? "0"
            : size >= 1e-3 && size < 1e6
              ? String(+v.toPrecision(digits))
              : v.toExponential(Math.min(4, digits - 1));
    return text
        .replace(/\.?0+e/, "e")
        .replace("e+", "e")
        .replace(/-/g, "−");
}

/** Boxes that are more elongated than this are drawn as if they were so. */
const ELONGATED = 4;

/** A time: of those far from 0, all digits that tell frames apart. */
const moment = (t) => (Math.abs(t) < 1e12 ? String(+t.toPrecision(10)).replace(/-/g, "−") : number(t));

/** A value without the digits that are lost between so many levels of a range. */
function rounded(v, { low, high }) {
    const grain = Math.max(high - low, 1e-15 * Math.max(Math.abs(low), Math.abs(high))) * 1e-7;
    if (!(grain > 0)) return v;
    const unit = 10 ** Math.ceil(Math.log10(grain));
    return Math.round(v / unit) * unit;
}

/** A value as text, with the digits that tell it from its neighbours far from 0. */
function reading(v, array) {
    const span = array.high - array.low,
        size = Math.max(Math.abs(array.low), Math.abs(array.high));
    const digits = span > 0 ? Math.ceil(Math.log10(size / span)) + 5 : 6;
    return digits > 6 && size < 1e12
        ? String(+v.toPrecision(Math.min(15, digits))).replace(/-/g, "−")
        : number(rounded(v, array));
}

/**
 * Round values between two ends with their labels, and, as `less`, what the labels leave out where they would all begin
 * alike.
 */
function ticks(low, high, most) {
    const span = high - low,
        size = Math.max(Math.abs(low), Math.abs(high));
    if (!(span > 1e-12 * size)) return Object.assign([[low, number(low)]], { less: "" });
    const power = 10 ** Math.floor(Math.log10(span / most)),
        step = [1, 2, 5, 10].map((m) => m * power).find((s) => span / s <= most);
    const ten = 10 ** Math.ceil(Math.log10(span)),
        start = span < 2e-3 * size ? Math.floor(low / ten + 1e-9) : 0;
    const less = start ? `${start > 0 ? " − " : " + "}${moment(+Math.abs(start * ten).toPrecision(14))}` : "",
        found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
        found.push([k * step, number(+(k * step - start * ten).toPrecision(8))]);
    return Object.assign(found, { less });
}

/** Powers of ten between two ends, about six at most, with their labels. */
function powers(low, high) {
    const from = Math.ceil(Math.log10(low) - 1e-9),
        to = Math.floor(Math.log10(high) + 1e-9),
        every = Math.ceil((to - from + 1) / 6),
        found = [];
    // of two powers or fewer also twice and five times
    const times = to - from < 2 ? [1, 2, 5] : [1];
    for (let k = times.length > 1 ? from - 1 : from; k <= to; k += every) {
        for (const m of times)
            if (m * 10 ** k >= low * (1 - 1e-9) && m * 10 ** k <= high * (1 + 1e-9))
                found.push([m * 10 ** k, number(+(m * 10 ** k).toPrecision(3))]);
    }
    return found;
}
