//! Memory budget for reading a file: the smallest of the limits of the job, the process and the machine.

use spherule_files::memory::{available, process_room};

use super::MemoryBudget;

/// Minimum budget, bytes. The survey needs it: a job with a tiny limit should be rejected because of the memory that
/// its frames need, not because they cannot be surveyed.
const MIN_BYTES: u64 = 8 << 20;

/// Budget for reading one file in a job with a memory `limit`, and a memory `ceiling` for the process of each frame,
/// both in bytes.
pub fn read_budget(limit: Option<u64>, ceiling: Option<u64>) -> MemoryBudget {
    let of_job = limit.map(|bytes| {
        let remedy = "raise render.memory_limit if there is more memory";
        MemoryBudget::new(bytes, remedy)
    });
    let of_frame = ceiling.map(|bytes| {
        let remedy = "raise job.memory_ceiling if there is more memory";
        MemoryBudget::new(reading_share(bytes), remedy)
    });
    smallest([of_job, of_frame])
}

/// Budget for reading one file in a conversion with the limit `memory`.
pub fn conversion_budget(memory: Option<MemoryBudget>) -> MemoryBudget {
    smallest([memory, None])
}

/// The smallest of the `requested` budgets and of those of the process and the machine.
fn smallest(requested: [Option<MemoryBudget>; 2]) -> MemoryBudget {
    let of_process = process_room().map(|bytes| {
        let remedy = "raise the memory limit of the process (ulimit, job.memory_ceiling)";
        MemoryBudget::new(reading_share(bytes), remedy)
    });
    let of_machine = available().map(|bytes| {
        let remedy = "that is what free memory allows: free some, or use a machine with more";
        MemoryBudget::new(reading_share(bytes), remedy)
    });
    let all = requested.into_iter().chain([of_process, of_machine]).flatten();
    let smallest = all.min_by_key(|budget| budget.bytes());
    smallest.map_or(MemoryBudget::UNLIMITED, |budget| budget.at_least(MIN_BYTES))
}

/// The share of `free` memory that reading may use, bytes; the rest is for the tree and the image.
const fn reading_share(free: u64) -> u64 {
    free / 4 * 3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_limit_applies() {
        assert_eq!(read_budget(Some(20 << 20), Some(1 << 40)).bytes(), 20 << 20);
        assert_eq!(read_budget(Some(1 << 40), Some(40 << 20)).bytes(), 30 << 20);
        assert_eq!(read_budget(Some(1), None).bytes(), MIN_BYTES);
        let limit = MemoryBudget::new(20 << 20, "");
        assert_eq!(conversion_budget(Some(limit)).bytes(), 20 << 20);
        assert_eq!(conversion_budget(None), read_budget(None, None));
    }
}
