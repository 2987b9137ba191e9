//! How much memory a study may take.

use crate::error::{Error, Result};
use std::path::Path;

/// Refuses a grid that needs more memory than this process may use: more than the machine has, than a container around
/// it may have, or than `ulimit -v` allows.
///
/// The limits are read as Linux tells them; on other systems none is known, and nothing is refused.
///
/// # Errors
/// [`Error::Invalid`] for `grid.cells`.
pub fn check_memory(nodes: u128, bytes_per_node: u128, cells: &[usize]) -> Result<()> {
    match least(Path::new("/")) {
        Some(limit) => limit.check(nodes, bytes_per_node, cells),
        None => Ok(()),
    }
}

/// The largest number of bytes, and who allows no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Limit {
    bytes: u128,
    whose: &'static str,
}

impl Limit {
    fn check(self, nodes: u128, bytes_per_node: u128, cells: &[usize]) -> Result<()> {
        let needed = nodes.saturating_mul(bytes_per_node);
        if needed <= self.bytes {
            return Ok(());
        }
        let gib = |bytes: u128| (bytes as f64 / (1_u64 << 30) as f64).ceil();
        let rule = format!(
            "{:.2e} nodes need about {:.3e} GiB and {} {}; lower it",
            nodes as f64,
            gib(needed),
            self.whose,
            gib(self.bytes)
        );
        Err(Error::invalid("grid.cells", format!("{cells:?}"), rule))
    }
}

/// The lowest of the limits that the files of Linux below `root` tell of.
fn least(root: &Path) -> Option<Limit> {
    let read = |path: &str| std::fs::read_to_string(root.join(path.trim_start_matches('/'))).unwrap_or_default();
    let machine = installed(&read("/proc/meminfo")).map(|bytes| Limit { bytes, whose: "this machine has" });
    let process = address_space(&read("/proc/self/limits")).map(|bytes| Limit { bytes, whose: "`ulimit -v` allows" });
    let groups = group_files(&read("/proc/self/cgroup"));
    let container = groups.iter().filter_map(|file| read(file).trim().parse().ok()).min();
    let container = container.map(|bytes| Limit { bytes, whose: "the container around it has" });
    [machine, container, process].into_iter().flatten().min()
}

/// All memory of the machine, in bytes, from `/proc/meminfo`: `MemTotal:  16384256 kB`.
fn installed(meminfo: &str) -> Option<u128> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u128>().ok()?)
}

/// The soft limit of `ulimit -v`, in bytes, from `/proc/self/limits`; none where it is `unlimited`.
fn address_space(limits: &str) -> Option<u128> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Files with the limits of the control groups of a process and of all groups around them, of either version, from
/// `/proc/self/cgroup`: `0::/a/b` in version 2, `9:memory:/a/b` in version 1.
fn group_files(groups: &str) -> Vec<String> {
    let mut files = Vec::new();
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (parts.next(), parts.next()) else { continue };
        let (directory, file) = match controllers.split(',').any(|name| name == "memory") {
            true => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            false if controllers.is_empty() => ("/sys/fs/cgroup", "memory.max"),
            false => continue,
        };
        let around = Path::new(group).ancestors().filter_map(Path::to_str);
        files.extend(around.map(|group| format!("{directory}/{}/{file}", group.trim_matches('/'))));
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = "MemTotal:        8388608 kB\nMemFree:          100000 kB\n";
    const LIMITS: &str = "Limit                     Soft Limit           Hard Limit           Units     \n\
                          Max cpu time              unlimited            unlimited            seconds   \n";

    /// The limit of a machine with these files, in MiB, and whose it is.
    fn limit(files: &[(&str, &str)]) -> Option<(u128, &'static str)> {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        least(root.path()).map(|limit| (limit.bytes >> 20, limit.whose))
    }

    /// A machine of 8 GiB; a group around the process has 2 GiB, whichever version tells it and however deep the
    /// process is.
    #[test]
    fn the_lowest_of_all_limits_counts() {
        let machine = ("proc/meminfo", MACHINE);
        assert_eq!(limit(&[machine]), Some((8192, "this machine has")));
        let second = [
            machine,
            ("proc/self/cgroup", "0::/jobs/17\n"),
            ("sys/fs/cgroup/jobs/17/memory.max", "max\n"),
            ("sys/fs/cgroup/jobs/memory.max", "2147483648\n"),
        ];
        assert_eq!(limit(&second), Some((2048, "the container around it has")));
        let own_view = [machine, ("proc/self/cgroup", "0::/\n"), ("sys/fs/cgroup/memory.max", "1073741824\n")];
        assert_eq!(limit(&own_view), Some((1024, "the container around it has")));
        let first = [
            machine,
            ("proc/self/cgroup", "11:cpu,cpuacct:/a\n9:memory:/docker/ab12\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "2147483648\n"),
        ];
        assert_eq!(limit(&first), Some((2048, "the container around it has")));
        let unlimited = [
            machine,
            ("proc/self/cgroup", "9:memory:/\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n"),
        ];
        assert_eq!(limit(&unlimited), Some((8192, "this machine has")));
    }

    /// `ulimit -v 3145728` is in KiB, its file in bytes; without a limit it says `unlimited`.
    #[test]
    fn the_limit_of_the_shell_counts() {
        let line = |soft: &str| {
            format!("{LIMITS}Max address space         {soft}           unlimited            bytes     \n")
        };
        let with = |soft: &str| limit(&[("proc/meminfo", MACHINE), ("proc/self/limits", &line(soft))]);
        assert_eq!(with("3221225472"), Some((3072, "`ulimit -v` allows")));
        assert_eq!(with("unlimited"), Some((8192, "this machine has")));
        assert_eq!(limit(&[("proc/self/limits", &line("unlimited"))]), None);
    }

    /// What is refused names both sizes and whose limit it is; what fits passes.
    #[test]
    fn a_grid_that_does_not_fit_is_refused() {
        let limit = Limit { bytes: 4 << 30, whose: "the container around it has" };
        assert!(limit.check(1 << 20, 4096, &[1023, 1023]).is_ok());
        let error = limit.check((1 << 20) + 1, 4096, &[1023, 1024]).unwrap_err().to_string();
        assert!(
            error.contains("`grid.cells` is [1023, 1024]") && error.contains("container around it has 4"),
            "{error}"
        );
    }

    /// On this machine something is known, and it is more than nothing.
    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_has_memory() {
        assert!(least(Path::new("/")).unwrap().bytes > 1 << 24);
    }
}
