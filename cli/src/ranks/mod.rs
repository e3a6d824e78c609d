//! This process among those that `mpirun` or `srun` has started together.

mod silence;
mod team;

pub use silence::{Silence, hush};
pub use team::{Lead, Team, named};

use std::process::Command;

/// The variable that makes a process forget its rank: for scripts that give each rank a command of its own.
pub const ALONE: &str = "KERRLIGHT_ALONE";

/// Variables by which launchers tell a process its rank and how many there are: Open MPI, MPICH and its relatives, and
/// the tasks of a step of Slurm.
const VARIABLES: [[&str; 2]; 3] = [
    ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"],
    ["PMI_RANK", "PMI_SIZE"],
    ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS"],
];

/// Rank and number of ranks; nothing if the process was started alone.
pub fn this() -> Option<(u32, u32)> {
    of(|name| std::env::var(name).ok())
}

/// Whether another process speaks for this one.
pub fn is_silent() -> bool {
    this().is_some_and(|(rank, _)| rank > 0)
}

/// Has a command started by this process know nothing of ranks: it is no part of the job.
pub fn forget(command: &mut Command) {
    command.env(ALONE, "1");
}

fn of(variable: impl Fn(&str) -> Option<String>) -> Option<(u32, u32)> {
    if variable(ALONE).is_some_and(|text| !text.is_empty()) {
        return None;
    }
    let number = |name: &str| variable(name)?.trim().parse::<u32>().ok();
    let both = |[rank, size]: &[&str; 2]| Some((number(rank)?, number(size)?));
    VARIABLES.iter().find_map(both).filter(|(rank, size)| *size > 1 && rank < size)
}

#[cfg(test)]
mod tests {
    #[test]
    fn exact_ranks_are_those_of_the_launcher() {
        let of = |set: &[(&str, &str)]| {
            super::of(|name| set.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned()))
        };
        assert_eq!(
            of(&[("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "4")]),
            Some((2, 4))
        );
        assert_eq!(of(&[("PMI_RANK", "0"), ("PMI_SIZE", "7")]), Some((0, 7)));
        // A script of Slurm is no step of it.
        assert_eq!(of(&[("SLURM_PROCID", "0"), ("SLURM_NTASKS", "4")]), None);
        assert_eq!(of(&[("PMI_RANK", "0"), ("PMI_SIZE", "1")]), None);
        assert_eq!(of(&[("PMI_RANK", "1"), ("PMI_SIZE", "2"), (super::ALONE, "1")]), None);
        assert_eq!(of(&[("PMI_RANK", "x"), ("PMI_SIZE", "2")]), None);
    }
}
