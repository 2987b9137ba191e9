/// The solution of a tridiagonal system by elimination without pivoting, Thomas' algorithm
///
/// ```text
/// l_i x_{i−1} + d_i x_i + u_i x_{i+1} = r_i,   i = 0 … n−1,   l_0 = u_{n−1} = 0
/// ```
///
/// `rows[i]` is [l_i, d_i, u_i], `right[i]` is r_i; l_0 and u_{n−1} are not read. Stable where |d_i| ≥ |l_i| + |u_i|. A
/// pivot that vanishes leaves values that are not finite.
///
/// # Example
/// ```
/// use driftmesh::numerics::linear::tridiagonal;
///
/// assert_eq!(tridiagonal(&[[0.0, 2.0, -1.0], [-1.0, 2.0, 0.0]], &[1.0, 1.0]), [1.0, 1.0]);
/// ```
#[must_use]
pub fn tridiagonal(rows: &[[f64; 3]], right: &[f64]) -> Vec<f64> {
    let n = rows.len();
    let mut above = vec![0.0; n];
    let mut x = vec![0.0; n];
    let (mut c, mut d) = (0.0, 0.0);
    for i in 0..n {
        let [lower, own, upper] = rows[i];
        let pivot = 1.0 / (own - lower * c);
        (c, d) = (upper * pivot, (right[i] - lower * d) * pivot);
        (above[i], x[i]) = (c, d);
    }
    for i in (0..n.saturating_sub(1)).rev() {
        x[i] -= above[i] * x[i + 1];
    }
    x
}
