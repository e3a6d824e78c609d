//! The help page of the program, with the verbs in groups.

use crate::Arguments;
use clap::{Command, CommandFactory};

/// Verbs by what they are about, in the order of the help page.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Pictures", &["render", "movie", "view"]),
    ("Rays", &["trace", "critical-curve", "accuracy"]),
    ("Data", &["observe", "uv", "convert"]),
    ("Fits", &["fit", "posterior", "compare"]),
    ("Other", &["inspect", "devices"]),
];

/// The command line, whose help page shows the verbs in groups.
pub fn command() -> Command {
    let command = Arguments::command();
    let verbs = grouped(&command);
    command.help_template(format!(
        "{{about}}\n{{usage-heading}} kerrlight [OPTIONS] VERB ...   or   kerrlight VERB --help\n{verbs}Options:\n{{options}}{{after-help}}"
    ))
}

/// The verbs with what they do, a heading a group.
fn grouped(command: &Command) -> String {
    let line = |name: &&str| {
        let about = command.find_subcommand(name).and_then(Command::get_about);
        format!("  {name:<16}{}\n", about.map(ToString::to_string).unwrap_or_default())
    };
    let group = |(heading, verbs): &(&str, &[&str])| {
        format!("{heading}:\n{}", verbs.iter().map(line).collect::<String>())
    };
    GROUPS.iter().map(group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_every_verb_is_in_one_group() {
        let command = Arguments::command();
        for verb in command.get_subcommands().map(Command::get_name) {
            let count = GROUPS.iter().flat_map(|(_, verbs)| *verbs).filter(|v| **v == verb).count();
            assert_eq!(count, 1, "{verb}");
        }
        assert!(!grouped(&command).contains("  \n"));
    }
}
