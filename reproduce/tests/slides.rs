//! The slides' own figures.

/// The fit to the slides' table.
#[test]
fn the_published_kind_fits_the_slides() {
    let expected = [10.84, 3.19, 1.03];
    for (nx, expected) in [10, 20, 40].into_iter().zip(expected) {
        let found = driftmesh_reproduce::slides_error(nx).unwrap();
        println!("{nx}: {}", 1e3 * found);
        assert!((1e3 * found / expected - 1.0).abs() <= 0.02, "{nx}: {found}");
    }
}
