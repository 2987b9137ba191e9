//! What is wrong in the paper, each with a check.

use crate::Rerun;
use crate::errata::{self, row};
use driftmesh::error::Result;
use std::f64::consts::PI;

const NU: f64 = 0.005;

pub fn errata() -> Result<Rerun> {
    let mut table = errata::table("Bihlo, Haynes and Walsh (2015)");
    for row in [sign(), time(), displacement(), ratios(), decimals()] {
        table.row(row);
    }
    table.note(
        "without a number to check: ∇ of (3.1b) is by ξ, since Φ moves in ξ; as printed it is by x̃, in which \
         ρ is frozen",
    );
    table.note(
        "not given, and so guessed in the items above: τ in every example, the filter of the density, the form of \
         the convection, α in 4.3 and 4.4, of which variable the density of the shallow water in 4.4 is made (the \
         height here), the shape of the pile there, N and M of table 2",
    );
    Ok(vec![table].into())
}

/// u_t, u_x and u_xx of u = 1/(1 + exp(z)), z = (x + y − t)/(2ν), in closed form.
fn derivatives(z: f64) -> [f64; 4] {
    let u = 1.0 / (1.0 + z.exp());
    let slope = u * (1.0 - u) / (2.0 * NU);
    [u, slope, -slope, slope * (1.0 - 2.0 * u) / (2.0 * NU)]
}

fn sign() -> Vec<String> {
    let [u, u_t, u_x, u_xx] = derivatives(0.7);
    let residual = |sign: f64| (u_t + 2.0 * u * u_x + sign * 2.0 * NU * u_xx) / u_t;
    let [printed, right] = [residual(1.0), residual(-1.0)];
    row(
        [
            "(4.1)",
            "… + ν(u_xx + u_yy) = 0",
            "… − ν(u_xx + u_yy) = 0",
            "the exact solution at x + y − t = .007: residual over u_t is 0",
        ],
        [format!("{printed:.3}"), format!("{:.0e}", right.abs())],
        [printed.abs() < 1e-12, right.abs() < 1e-12],
    )
}

fn time() -> Vec<String> {
    let [u, u_t, u_x, u_xx] = derivatives(0.7);
    // with t₀ in place of t nothing changes in time
    let residual = |u_t: f64| (u_t + 2.0 * u * u_x - 2.0 * NU * u_xx) / u_x;
    let [printed, right] = [residual(0.0), residual(u_t)];
    row(
        [
            "exact solution of 4.1",
            "exp((x + y − t₀)/(2ν))",
            "exp((x + y − t)/(2ν))",
            "residual of Burgers' equation over u_x is 0",
        ],
        [format!("{printed:.3}"), format!("{:.0e}", right.abs())],
        [printed.abs() < 1e-12, right.abs() < 1e-12],
    )
}

/// b x_ξ + x_ξξ of x = X + Lξ beside b X_ξ + X_ξξ and the printed source.
fn displacement() -> Vec<String> {
    let (length, xi) = (2.0 * PI, 0.3_f64);
    let b = (2.0 * PI * xi).cos();
    let (x_xi, x_xixi) = (0.2 * PI * (2.0 * PI * xi).cos(), -0.4 * PI * PI * (2.0 * PI * xi).sin());
    let velocity = b * (x_xi + length) + x_xixi;
    let by = |source: f64| b * x_xi + x_xixi + source - velocity;
    let [printed, right] = [by(b * (1.0 + length)), by(b * length)];
    row(
        [
            "mesh equation for X, section 2",
            "… + (ρ_ξ/ρ)(1 + L_x)",
            "… + (ρ_ξ/ρ) L_x",
            "X = .1 sin 2πξ, b = cos 2πξ, L = 2π: difference to (2.4) is 0",
        ],
        [format!("{printed:.3}"), format!("{:.0e}", right.abs())],
        [printed.abs() < 1e-12, right.abs() < 1e-12],
    )
}

/// R_max and R_mean of tables 1, 3 and 4, as printed.
const PRINTED: [(f64, f64); 21] = [
    (0.99, 0.99),
    (0.99, 0.99),
    (1.0, 1.0),
    (0.95, 0.98),
    (0.97, 0.99),
    (0.92, 1.0),
    (0.95, 0.98),
    (0.97, 0.99),
    (1.0, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (1.0, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (0.97, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
    (0.99, 1.0),
];

fn ratios() -> Vec<String> {
    let below = PRINTED.iter().filter(|(max, mean)| max < mean).count();
    row(
        [
            "section 3.7",
            "R_max: the largest R(K) over the cells",
            "presumably max Q of one domain over max Q of the subdomains",
            "pairs of tables 1, 3 and 4 in which R_max is below R_mean, which a largest value cannot be and a ratio \
             of largest ones can",
        ],
        [format!("{below} of {}", PRINTED.len()), "no contradiction".into()],
        [below == 0, true],
    )
}

fn decimals() -> Vec<String> {
    let (one_domain, printed, right) = ([0.031, 0.030, 0.030], [0.320, 0.35, 0.24], [0.032, 0.035, 0.024]);
    let worst = |values: [f64; 3]| values.iter().zip(one_domain).map(|(v, one)| v / one).fold(0.0, f64::max);
    row(
        [
            "table 1",
            "l_inf of .320, .35 and .24",
            "presumably .032, .035 and .024",
            "the text: errors on subdomains approximately equal those of one domain. The largest of these three over \
             its column of one domain",
        ],
        [format!("{:.1}", worst(printed)), format!("{:.2}", worst(right))],
        [worst(printed) < 1.5, worst(right) < 1.5],
    )
}
