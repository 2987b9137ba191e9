use crate::error::{Error, Result};

/// Refuses a grid that needs more memory than the machine has.
///
/// # Errors
/// [`Error::Invalid`] for `grid.cells`.
pub fn check_memory(nodes: u128, bytes_per_node: u128, cells: &[usize]) -> Result<()> {
    let there = sysinfo::System::new().map_or(u128::MAX, |mut system| {
        system.refresh_memory();
        // a container may have less than its machine
        let limit = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory);
        u128::from(system.total_memory().min(limit))
    });
    let needed = nodes.saturating_mul(bytes_per_node);
    if needed <= there {
        return Ok(());
    }
    let gib = |bytes: u128| (bytes as f64 / (1_u64 << 30) as f64).ceil();
    let rule = format!(
        "{:.2e} nodes need about {:.3e} GiB and this machine has {}; lower it",
        nodes as f64,
        gib(needed),
        gib(there)
    );
    Err(Error::invalid("grid.cells", format!("{cells:?}"), rule))
}
