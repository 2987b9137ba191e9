//! Pieces of a line, given by the first and the last node of each, from left to right.

use super::Method;
use crate::error::{Error, Result};

/// A place in ξ may be off its node by this share of a cell: rounding of the number that was written.
const ROUNDING: f64 = 1e-9;

/// The number of the node at ξ.
///
/// # Errors
/// [`Error::Invalid`] with the key where there is no node: ξ is not rounded to the nearest one.
pub fn node(key: &str, xi: f64, cells: usize) -> Result<usize> {
    let place = xi * cells as f64;
    let near = place.round();
    if !(0.0..=1.0).contains(&xi) {
        return Err(Error::invalid(key, xi, "must be a place on the line: from 0 to 1"));
    }
    if (place - near).abs() <= ROUNDING {
        return Ok(near as usize);
    }
    let [below, above] = [place.floor(), place.ceil()].map(|node| node / cells as f64);
    let rule = format!("must be a node; with {cells} cells the nearest are {below} and {above}");
    Err(Error::invalid(key, xi, rule))
}

/// Pieces of equal width, neighbours of which overlap by a number of cells.
///
/// # Errors
/// [`Error::Invalid`] for `subdomains` where no equal pieces fit.
pub fn equal(cells: usize, subdomains: usize, overlap: usize) -> Result<Vec<[usize; 2]>> {
    let invalid = |rule: String| Err(Error::invalid("subdomains", subdomains, rule));
    if subdomains == 0 || subdomains > cells {
        return invalid(format!("must be between 1 and the number of cells, {cells}"));
    }
    let shared = overlap.saturating_mul(subdomains - 1);
    let all = cells.saturating_add(shared);
    let (width, left) = (all / subdomains, all % subdomains);
    if left != 0 {
        // more cells fit as long as every piece is longer than its overlaps
        let fits = |width: usize| (width * subdomains).checked_sub(shared).filter(|cells| *cells > 0);
        let near: Vec<String> =
            [width, width + 1].into_iter().filter_map(fits).map(|cells| cells.to_string()).collect();
        return invalid(format!(
            "(cells + {} × {overlap})/{subdomains} must be whole; with {overlap} cells of overlap the nearest \
             grid.cells are {}",
            subdomains - 1,
            near.join(" and ")
        ));
    }
    if subdomains > 1 && width <= overlap {
        return invalid(format!("each would be {width} cells wide, no wider than its overlap of {overlap}"));
    }
    Ok((0..subdomains).map(|s| [s * (width - overlap), s * (width - overlap) + width]).collect())
}

/// Refuses pieces that a method cannot work with.
///
/// # Errors
/// [`Error::Invalid`] with the key.
pub fn check(key: &str, ranges: &[[usize; 2]], cells: usize, method: Method) -> Result<()> {
    let shown =
        |range: &[usize; 2]| format!("[{}, {}]", range[0] as f64 / cells as f64, range[1] as f64 / cells as f64);
    let all = || ranges.iter().map(shown).collect::<Vec<_>>().join(", ");
    let invalid = |rule: String| {
        let value = match ranges.len() {
            0 => "[]".into(),
            1..9 => all(),
            _ => "given".into(),
        };
        Err(Error::invalid(key, value, rule))
    };
    let [Some(first), Some(last)] = [ranges.first(), ranges.last()] else {
        return invalid("there must be a subdomain".into());
    };
    if first[0] != 0 || last[1] != cells {
        return invalid("the first subdomain must begin at 0, and the last end at 1".into());
    }
    if let Some(turned) = ranges.iter().find(|[first, last]| last < first) {
        return invalid(format!("{} runs from right to left; give them in order", shown(turned)));
    }
    if let Some(thin) = ranges.iter().find(|[first, last]| *last < first + 2) {
        return invalid(format!("the subdomain {} has no node inside; use fewer of them, or more cells", shown(thin)));
    }
    let overlapping = matches!(method, Method::Classical { .. });
    for pair in ranges.windows(2) {
        let ([begin, end], [next, next_end]) = (pair[0], pair[1]);
        let between = format!("{} and {}", shown(&pair[0]), shown(&pair[1]));
        if next <= begin || next_end <= end {
            return invalid(format!("subdomains must go from left to right, none inside another: not {between}"));
        }
        if next > end {
            return invalid(format!("nothing covers the line between {between}"));
        }
        if overlapping && next == end {
            return invalid(format!(
                "{between} do not overlap: with each other's values at their ends they would never learn of each \
                 other; give an overlap, or use the method \"optimized\""
            ));
        }
        if !overlapping && next < end {
            return invalid(format!("{between} overlap; this method needs cuts, or use the method \"classical\""));
        }
    }
    match ranges.windows(3).find(|three| three[2][0] < three[0][1]) {
        None => Ok(()),
        Some(three) => invalid(format!(
            "{} and {} overlap and are no neighbours; an overlap can be half of a subdomain at most",
            shown(&three[0]),
            shown(&three[2])
        )),
    }
}
