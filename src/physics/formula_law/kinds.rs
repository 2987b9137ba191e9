//! What each equation of a study is, as its formulas tell.

use crate::formula::Formula;
use crate::physics::bounds::{SAMPLES, sampled};
use crate::physics::finite_volumes::Limited;
use crate::physics::formula_pde::{Formulas, Scheme};
use crate::physics::sides::Open;

/// Properties of the unknowns of some equations, as the formulas tell them.
pub(super) struct Kinds<const B: usize> {
    pub limited: Limited<B>,
    /// Unknowns with implicit fluxes that are limited where cells are too wide for central ones.
    pub damped: [bool; B],
    /// Unknowns whose flux is a function of themselves alone.
    pub has_own_flux: [bool; B],
    /// Unknowns whose diffusivity is 0 wherever some unknown has a certain value.
    pub vanishes: [bool; B],
    /// Values of each unknown at which its own diffusivity is 0, whatever gradients that takes; empty for unknowns with
    /// other terms that take gradients, or with a storage.
    pub vanishing: [Vec<f64>; B],
    /// Unknowns whose mass neighbours share where cells grow: those with implicit fluxes, without a storage, and with a
    /// diffusivity that is the same in all directions and vanishes at no value, unless the source is nonlinear. None in
    /// other than Cartesian coordinates, where cells along a radius have another mass.
    pub shares: [bool; B],
    /// Unknowns in `shares` whose source is not linear in them.
    pub bends: [bool; B],
    /// Unknowns in `bends` whose source does not depend on place.
    pub reacts_alike: [bool; B],
    /// Unknowns in `shares` whose source is the sum of a function of place and time and one of unknowns and time.
    pub loaded: [bool; B],
    /// Unknowns that are only carried and diffused, and so keep the range of their data.
    pub keeps_range: [bool; B],
    /// Whether an unknown without diffusion has a flux that is not linear in the unknowns.
    pub forms_shocks: bool,
    /// Unknowns that have a source, no term that takes gradients, no storage, and no flux that is given on a side.
    pub reacts: [bool; B],
    /// Sides through which something flows that is not given there, as (axis, end).
    pub open: Vec<(usize, usize)>,
}

impl<const B: usize> Kinds<B> {
    pub fn of<const D: usize>(formulas: &Formulas<D>, cartesian: bool) -> Self {
        let Formulas { nodal, sides, scheme, terms, .. } = formulas;
        let is_zero = |quantity: usize, c: usize| nodal[quantity * B + c].text() == "0";
        // fluxes come first
        let (diffuses, has_source) = (|c: usize| !is_zero(D, c), |c: usize| !is_zero(D + 1, c));
        let by_gradients = |c: usize| terms.has_flux(c) || terms.has_source(c);
        let is_plain = |c: usize| !by_gradients(c) && !terms.has_storage(c);
        // derivatives by unknowns follow all quantities themselves, unknown by unknown
        let by_unknown = |c: usize, e: usize| &nodal[((D + 2) * (1 + e) + D + 1) * B + c];
        let steepens = |c: usize| {
            // derivatives of the flux by an unknown that depend on one
            let speeds = (0..D).flat_map(|d| (0..B).map(move |e| &nodal[((D + 2) * (1 + e) + d) * B + c]));
            speeds.into_iter().any(|speed| (0..B).any(|e| speed.depends_on(D + e)))
        };
        let bends = |c: usize| (0..B).any(|e| by_unknown(c, c).depends_on(D + e));
        // what diffuses by a diffusivity that takes gradients, along each axis
        let steep = |c: usize| match terms.fluxes.get(c) {
            Some(Some(along)) if !diffuses(c) => {
                (0..D).all(|d| along[d].depends_on(D + B + c * D + d)).then_some(&along[..])
            }
            _ => None,
        };
        let vanishing = |c: usize, e: usize| match steep(c) {
            None => zeros(&nodal[D * B + c], D + e),
            Some(along) => {
                let mut values = zeros(&along[0], D + e);
                values.retain(|value| along.iter().all(|flux| zeros(flux, D + e).contains(value)));
                values
            }
        };
        let spreads = |c: usize| diffuses(c) || steep(c).is_some();
        let vanishes: [bool; B] = std::array::from_fn(|c| spreads(c) && (0..B).any(|e| !vanishing(c, e).is_empty()));
        let only_spreads = |c: usize| steep(c).is_some() && !terms.has_source(c) && !terms.has_storage(c);
        let limited: [bool; B] = std::array::from_fn(|c| match scheme {
            None => !diffuses(c) && !terms.has_flux(c) && !terms.has_storage(c),
            Some(scheme) => *scheme == Scheme::Limited,
        });
        let changed = |c: usize| diffuses(c) || has_source(c) || by_gradients(c);
        let by_others = |c: usize| (0..D).any(|d| (0..B).any(|e| !limited[e] && nodal[d * B + c].depends_on(D + e)));
        let flux_is_own = |c: usize| {
            let mut fluxes = (0..D).map(|d| &nodal[d * B + c]);
            fluxes.all(|flux| (0..D + B).all(|v| v == D + c || !flux.depends_on(v)))
        };
        let keeps_range = |c: usize| {
            let flows = (0..D).any(|d| !is_zero(d, c));
            // of the unknown alone, so that no place draws it together; else where the flux ends it would pile up
            !has_source(c)
                && flux_is_own(c)
                && is_plain(c)
                && (cartesian || !flows)
                && sides[c].as_flattened().iter().all(|end| adds_nothing(end, flows))
        };
        let on_place = |formula: &Formula| (0..D).any(|d| formula.depends_on(d));
        let is_loaded = |c: usize| on_place(&nodal[(D + 1) * B + c]) && !(0..B).any(|e| on_place(by_unknown(c, e)));
        // where diffusion vanishes nothing damps what overshoots; where the source bends, that is seen at each step
        let damps = |c: usize| !vanishes[c] || bends(c);
        let shares = |c: usize| cartesian && diffuses(c) && damps(c) && !limited[c] && !terms.has_storage(c);
        let bends = |c: usize| shares(c) && bends(c);
        let reacts_alike = |c: usize| bends(c) && !on_place(&nodal[(D + 1) * B + c]);
        let is_fed = |c: usize| sides[c].as_flattened().iter().any(|end| matches!(end, Open::Flux(_)));
        let lets_through = |end: &Open| matches!(end, Open::Outflow | Open::Flux(_));
        let opens = |&(d, end): &(usize, usize)| sides.iter().any(|sides| lets_through(&sides[d][end]));
        Self {
            limited: Limited {
                unknowns: limited,
                implicit: (0..B).any(|c| !limited[c] || changed(c)),
                coupled: (0..B).any(|c| limited[c] && (changed(c) || by_others(c))),
            },
            damped: limited.map(|limited| !limited && scheme.is_none()),
            has_own_flux: std::array::from_fn(flux_is_own),
            vanishes,
            vanishing: std::array::from_fn(
                |c| if is_plain(c) || only_spreads(c) { vanishing(c, c) } else { Vec::new() },
            ),
            shares: std::array::from_fn(shares),
            bends: std::array::from_fn(bends),
            reacts_alike: std::array::from_fn(reacts_alike),
            keeps_range: std::array::from_fn(keeps_range),
            forms_shocks: (0..B).any(|c| limited[c] && !diffuses(c) && steepens(c)),
            loaded: std::array::from_fn(|c| shares(c) && is_loaded(c)),
            reacts: std::array::from_fn(|c| has_source(c) && is_plain(c) && !is_fed(c)),
            open: (0..D).flat_map(|d| [(d, 0), (d, 1)]).filter(opens).collect(),
        }
    }
}

/// Whether a side adds nothing to an unknown; `flows` says that a flux may carry it.
fn adds_nothing(end: &Open, flows: bool) -> bool {
    match end {
        Open::Value(_) | Open::Outflow => true,
        Open::Closed => !flows,
        Open::Flux(_) => false,
    }
}

/// Values of a variable at which a diffusivity is 0 whatever the other variables are, sought among 0, the numbers that
/// its formula names, and minus these.
fn zeros(diffusivity: &Formula, variable: usize) -> Vec<f64> {
    let is_zero = |value: &f64| {
        let at = |sample: usize| diffusivity.eval(&sampled(diffusivity, sample, (variable, *value)));
        (0..SAMPLES).all(|sample| at(sample) == 0.0)
    };
    let named = diffusivity.constants().flat_map(|number| [number, -number]);
    let values = [0.0].into_iter().chain(named).filter(|_| diffusivity.depends_on(variable));
    values.filter(is_zero).collect()
}
