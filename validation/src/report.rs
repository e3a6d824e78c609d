//! Reports of oracles.

use std::fmt::Write;

/// One comparison.
#[derive(Debug, Clone)]
pub struct Case {
    /// Source of the reference.
    pub authority: &'static str,
    /// Quantity that is compared.
    pub name: String,
    /// The authority's value, or what the sample is.
    pub expected: String,
    /// Measured value.
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

    /// Returns whether the error is allowed; NaN is not.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }

    /// The error over the allowed one; an allowed error of 0 counts as the smallest number.
    fn share(&self) -> f64 {
        self.error / self.allowed.max(f64::MIN_POSITIVE)
    }
}

/// Writes the document: for each authority its case that is nearest to its bound.
pub fn markdown(cases: &[Case]) -> String {
    let mut text = String::from(
        "# Validation\n\n`cargo run --release -p kerrlight-validation` writes this page and prints all cases, in 20 seconds. Do not edit it.\n\
         Errors are relative unless the case says otherwise; for a sample, the largest error is given.\n\n\
         | source | cases passed | case nearest to its bound | error | allowed |\n|---|---|---|---|---|\n",
    );
    for group in cases.chunk_by(|a, b| a.authority == b.authority) {
        let nearest = group.iter().max_by(|a, b| a.share().total_cmp(&b.share()));
        let Some(case) = nearest else { continue };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} of {} | {} | {:.1e} | {:.0e} |",
            case.authority,
            passed(group),
            group.len(),
            case.name,
            case.error,
            case.allowed
        );
    }
    text
}

/// Writes a line for each case, with the authority's value and the one found.
pub fn lines(cases: &[Case]) -> String {
    let mut text = String::new();
    for case in cases {
        let verdict = if case.passed() { "pass" } else { "FAIL" };
        let _ = writeln!(
            text,
            "{verdict}  {}: {}: expected {}, found {}, error {:.1e}, allowed {:.0e}",
            case.authority, case.name, case.expected, case.found, case.error, case.allowed
        );
    }
    text
}

/// Counts the cases that pass.
pub fn passed(cases: &[Case]) -> usize {
    cases.iter().filter(|case| case.passed()).count()
}
