//! What an oracle says, and how it is written down.

use std::fmt::Write;

/// One comparison.
#[derive(Debug, Clone)]
pub struct Case {
    /// Who says so.
    pub authority: &'static str,
    /// What is compared.
    pub name: String,
    /// The authority's value, or what the sample is.
    pub expected: String,
    /// What was found.
    pub found: String,
    /// The error, in the measure that the name tells.
    pub error: f64,
    /// The largest error that passes.
    pub allowed: f64,
}

impl Case {
    /// A number against the authority's, by relative error.
    pub fn number(
        authority: &'static str,
        name: impl Into<String>,
        expected: f64,
        found: f64,
        allowed: f64,
    ) -> Self {
        Case {
            authority,
            name: name.into(),
            expected: format!("{expected:.13}"),
            found: format!("{found:.13}"),
            error: (found / expected - 1.0).abs(),
            allowed,
        }
    }

    /// A sample of errors, by its largest.
    pub fn sample(
        authority: &'static str,
        name: impl Into<String>,
        what: &str,
        mut errors: Vec<f64>,
        allowed: f64,
    ) -> Self {
        errors.sort_by(f64::total_cmp);
        let at = |part: f64| errors[((errors.len() - 1) as f64 * part) as usize];
        Case {
            authority,
            name: name.into(),
            expected: format!("{} {what}", errors.len()),
            found: format!("median {:.1e}, 99 % {:.1e}", at(0.5), at(0.99)),
            error: at(1.0),
            allowed,
        }
    }

    /// Whether the error is allowed; NaN is not.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }
}

/// All cases as a document.
pub fn markdown(cases: &[Case]) -> String {
    let mut text = String::from(
        "# Validation\n\n`cargo run --release -p kerrlight-validation` writes this page in 20 seconds. Do not edit it.\n\
         Errors are relative unless the case says otherwise; for a sample, the largest error is given.\n\n\
         | source | case | expected | found | error | allowed | |\n|---|---|---|---|---|---|---|\n",
    );
    for case in cases {
        let verdict = if case.passed() { "pass" } else { "**FAIL**" };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.1e} | {:.0e} | {verdict} |",
            case.authority, case.name, case.expected, case.found, case.error, case.allowed
        );
    }
    let passed = cases.iter().filter(|case| case.passed()).count();
    let _ = write!(text, "\n{passed} of {} passed.\n", cases.len());
    text
}
