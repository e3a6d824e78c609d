//! This process among those that `mpirun` or `srun` has started together.

mod connection;
mod link;
mod silence;
mod team;

pub use connection::Connection;
pub use link::{Listener, join as connect};
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

/// Variables by which launchers name a job: Open MPI, and Slurm, whose jobs have steps.
const JOBS: [[&str; 2]; 2] =
    [["PMIX_NAMESPACE", "PMIX_NAMESPACE"], ["SLURM_JOB_ID", "SLURM_STEP_ID"]];

/// What tells this job from others, in letters that names of files may have; nothing if the launcher does not say.
fn job() -> String {
    job_of(|name| std::env::var(name).ok())
}

fn job_of(variable: impl Fn(&str) -> Option<String>) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let named = |[job, step]: &[&str; 2]| {
        let word = format!("_{}_{}", variable(job)?.trim(), variable(step)?.trim());
        Some(word.chars().map(|c| if c == '_' { c } else { plain(c) }).collect::<String>())
    };
    JOBS.iter().find_map(named).unwrap_or_default()
}

/// Variables by which launchers say how many ranks are on this machine.
const ON_THIS_HOST: [&str; 3] =
    ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_TASKS_PER_NODE"];

/// Whether all ranks are on this machine, as far as the launcher says so.
fn is_one_host(size: u32) -> bool {
    let size = size.to_string();
    ON_THIS_HOST.iter().filter_map(|name| std::env::var(name).ok()).any(|here| here.trim() == size)
}

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

    #[test]
    fn exact_jobs_have_names() {
        let of = |set: &[(&str, &str)]| {
            super::job_of(|name| set.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned()))
        };
        assert_eq!(of(&[]), "");
        assert_eq!(of(&[("SLURM_JOB_ID", "7")]), "");
        assert_eq!(of(&[("SLURM_JOB_ID", "7"), ("SLURM_STEP_ID", "0")]), "_7_0");
        assert_eq!(of(&[("PMIX_NAMESPACE", "a/b"), ("SLURM_JOB_ID", "7")]), "_a-b_a-b");
    }
}
