//! Memory budget for reading a file, from the limits of the job, the process and the machine.

use spherule_formats::MemoryBudget;

use crate::metrics::memory::{available, process_room};

/// Minimum budget: with a tiny limit, a job should be rejected because of what its frames need, not because they
/// cannot be surveyed.
const LEAST: u64 = 8 << 20;

/// Budget for reading one file in a job with a memory `limit`, and with a `ceiling` for the processes that make its
/// frames.
pub fn read_budget(limit: Option<u64>, ceiling: Option<u64>) -> MemoryBudget {
    let of_job = limit.map(|bytes| {
        let remedy = "raise render.memory_limit if there is more memory";
        MemoryBudget::new(bytes, remedy)
    });
    let of_frame = ceiling.map(|bytes| {
        let remedy = "raise job.memory_ceiling if there is more memory";
        MemoryBudget::new(part(bytes), remedy)
    });
    least([of_job, of_frame])
}

/// Budget for reading one file in a conversion with the limit `memory`.
pub fn conversion_budget(memory: Option<MemoryBudget>) -> MemoryBudget {
    least([memory, None])
}

/// The least of `asked` and of the budgets of process and machine.
fn least(asked: [Option<MemoryBudget>; 2]) -> MemoryBudget {
    let of_process = process_room().map(|bytes| {
        let remedy = "raise the memory limit of the process (ulimit, job.memory_ceiling)";
        MemoryBudget::new(part(bytes), remedy)
    });
    let of_machine = available().map(|bytes| {
        let remedy = "that is what free memory allows: free some, or use a machine with more";
        MemoryBudget::new(part(bytes), remedy)
    });
    let all = asked.into_iter().chain([of_process, of_machine]).flatten();
    let least = all.min_by_key(|budget| budget.bytes());
    least.map_or(MemoryBudget::UNLIMITED, |budget| budget.at_least(LEAST))
}

/// The fraction of `free` memory for reading; the rest is for the tree and the image.
const fn part(free: u64) -> u64 {
    free / 4 * 3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_all_limits_counts() {
        assert_eq!(read_budget(Some(20 << 20), Some(1 << 40)).bytes(), 20 << 20);
        assert_eq!(read_budget(Some(1 << 40), Some(40 << 20)).bytes(), 30 << 20);
        assert_eq!(read_budget(Some(1), None).bytes(), LEAST);
        let limit = MemoryBudget::new(20 << 20, "");
        assert_eq!(conversion_budget(Some(limit)).bytes(), 20 << 20);
        assert_eq!(conversion_budget(None), read_budget(None, None));
    }
}
