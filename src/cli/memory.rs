//! A limited address space (`ulimit -v`, batch systems).
//!
//! Memory that cannot be had ends a process at once. Where the address space is limited, the work is therefore done by
//! a child, whose end can be told of; and before that, with a single thread, since every thread that multiplies
//! matrices reserves room in proportion to the caches of the processor.

use std::io::Write;
use std::process::{Command, ExitCode, ExitStatus};

use crate::error::{Code, Error};

/// Tells a child how many threads it may have: as many as it likes, or one.
const CHILD: &str = "ROBOTCAL_IN_LIMITED_MEMORY";
const ONE_THREAD: &str = "one thread";

/// Runs the program in a child where the address space is limited; `None` where the caller is to do the work.
pub(super) fn in_a_child() -> Option<ExitCode> {
    let limit = limit_bytes()?;
    if std::env::var_os(CHILD).is_some() {
        return None;
    }
    for threads in ["all threads", ONE_THREAD] {
        let child = std::env::current_exe()
            .and_then(|program| Command::new(program).args(std::env::args_os().skip(1)).env(CHILD, threads).status());
        let ended = child.ok()?;
        if !lacked_memory(ended) {
            return Some(ended.code().and_then(|c| u8::try_from(c).ok()).map_or(ExitCode::FAILURE, ExitCode::from));
        }
    }
    let what = format!("the address space is limited to {} MB, and that was not enough", limit / 1_000_000);
    let error = Error::new(
        Code::MemoryExhausted,
        "memory",
        what,
        "raise the limit (ulimit -v), or give fewer or smaller images",
    );
    let _ = writeln!(std::io::stderr(), "error[{}]: {error}", error.code);
    Some(ExitCode::from(error.exit_code()))
}

/// The largest block, B, that glibc takes from its heaps, with room for its head.
const LARGEST_FROM_HEAP: usize = (32 << 20) - (64 << 10);

/// glibc maps blocks that are larger than every one that was freed, and trims a heap by twice as much: the matrices of every step would be given
/// back to the system and had from it again page by page. Once a large block was freed, they stay; not where memory is limited.
pub(super) fn keep_freed() {
    if std::env::var_os(CHILD).is_none() {
        drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST_FROM_HEAP)));
    }
}

/// Threads for every core that serve any purpose.
const MOST_FOR_A_CORE: usize = 4;

/// No more threads than the cores have work for: thousands of them would only wait for each other.
fn capped(wanted: usize, cores: usize) -> usize {
    wanted.min(MOST_FOR_A_CORE * cores)
}

/// Number of threads: that of the user, up to [`MOST_FOR_A_CORE`]; where memory is short only the present one.
pub(super) fn set_threads(wanted: Option<usize>) {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new();
    // Fails only where a pool exists already, which then serves as well.
    let _ = match (std::env::var(CHILD).is_ok_and(|c| c == ONE_THREAD), wanted) {
        (true, _) => pool.num_threads(1).use_current_thread().build_global(),
        (false, Some(threads)) => pool.num_threads(capped(threads, cores)).build_global(),
        (false, None) => Ok(()),
    };
}

/// Limit of the address space, where there is one.
fn limit_bytes() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|l| l.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// What a panic says where a thread, or memory for it, could not be had.
const LACKING: [&str; 3] = ["failed to spawn thread", "ThreadPoolBuildError", "Cannot allocate memory"];

fn is_of_lack(panic: &str) -> bool {
    LACKING.iter().any(|words| panic.contains(words))
}

/// In such a child a panic for lack of memory aborts, as allocations do: so it is told from every other.
pub(super) fn abort_where_it_lacks() {
    if std::env::var_os(CHILD).is_none() {
        return;
    }
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        usual(panic);
        if is_of_lack(&panic.to_string()) {
            std::process::abort();
        }
    }));
}

/// Ended by an allocation, a stack or a thread that could not be had.
#[cfg(unix)]
fn lacked_memory(ended: ExitStatus) -> bool {
    use std::os::unix::process::ExitStatusExt;
    const ABORT: i32 = 6;
    const BUS: i32 = 7;
    const SEGMENT: i32 = 11;
    ended.signal().is_some_and(|s| [ABORT, BUS, SEGMENT].contains(&s))
}

#[cfg(not(unix))]
fn lacked_memory(_: ExitStatus) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::{capped, is_of_lack};

    #[test]
    fn a_panic_is_no_lack_of_memory_unless_it_says_so() {
        assert!(!is_of_lack(
            "panicked at src/solve/block.rs:7:5:\nindex out of bounds: the len is 0 but the index is 0"
        ));
        for lack in [
            "failed to spawn thread: Os { code: 11, kind: WouldBlock, message: \"Resource temporarily unavailable\" }",
            "The global thread pool has not been initialized.: ThreadPoolBuildError { kind: IOError(Os { code: 11 }) }",
        ] {
            assert!(is_of_lack(lack), "{lack}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn the_code_of_a_child_that_panicked_is_passed_on() {
        use std::os::unix::process::ExitStatusExt;
        let [panicked, aborted] = [101 << 8, 6].map(std::process::ExitStatus::from_raw);
        assert_eq!([panicked, aborted].map(super::lacked_memory), [false, true]);
    }

    #[test]
    fn a_core_gets_four_threads_at_most() {
        assert_eq!([1, 8, 9, 5000].map(|wanted| capped(wanted, 2)), [1, 8, 8, 8]);
        assert_eq!(capped(0, 2), 0, "all cores");
    }
}
