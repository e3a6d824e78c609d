//! Writing the tables of the EHT's public releases: total intensity, amplitude and phase.

use super::table;
use crate::Error;
use crate::observation::{MissingMetadata, Observation};
use core::fmt::Write;

/// Columns of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EhtTable {
    /// Separated by commas.
    Csv,
    /// Aligned with blanks.
    Txt,
}

/// Stokes I of every row that has it, laid out as the EHT publishes it: hours of UTC, amplitude
/// and σ to 8 decimals, (u, v) and phase (degrees) to 4, the frequency of the heading to 0.1 MHz.
///
/// # Errors
/// If the date or the frequency is not known, there are several spectral channels, something is not a finite number, or an
/// error has no digit of these.
pub fn to_eht_table(observation: &Observation, style: EhtTable) -> Result<String, Error> {
    super::one_channel(observation)?;
    super::check_numbers(observation)?;
    // Half of the eighth decimal: less would be written as 0.
    let is_lost = |sigma: f64| sigma > 0.0 && sigma < 5e-9;
    if let Some((row, i)) = observation.stokes_i().find(|(_, i)| is_lost(i.noise_sigma)) {
        let ([a, b], sigma) = (observation.names(row), i.noise_sigma);
        let message = format!(
            "sigma of {a}-{b} at {} h = {sigma:e} Jy: this format has 8 decimals",
            row.time_h
        );
        return Err(super::FileError::whole(message).into());
    }
    let mjd = observation.mjd.ok_or(MissingMetadata("the date (MJD)"))?;
    let frequency = observation.frequency_hz.ok_or(MissingMetadata("the frequency"))? / 1e9;
    let ends = |letter: char| letter.is_control() || matches!(letter, ' ' | ',');
    let source = observation.source.replace(ends, "_");
    let names = table::EHT_COLUMNS;
    let mut text = match style {
        EhtTable::Csv => {
            format!("#SRC:{source},DATE(MJD):{mjd},FREQ:{frequency:.4}GHz\n#{}\n", names.join(","))
        }
        EhtTable::Txt => format!(
            "# SRC:{source} DATE(MJD):{mjd} FREQ:{frequency:.4}GHz\n\
             # {:<15}{:<7}{:<5}{:<17}{:<18}{:<12}{:<12}{}\n",
            names[0], names[1], names[2], names[3], names[4], names[5], names[6], names[7]
        ),
    };
    for (row, i) in observation.stokes_i() {
        let ([t1, t2], [u, v]) = (observation.names(row), row.uv);
        let (amplitude, phase) = i.visibility.to_polar();
        let (time, phase, sigma) = (row.time_h, phase.to_degrees(), i.noise_sigma);
        // Writing into a string cannot fail.
        let _ = match style {
            EhtTable::Csv => writeln!(
                text,
                "{time:011.8},{t1},{t2},{u:.4},{v:.4},{amplitude:.8},{phase:.4},{sigma:.8}"
            ),
            EhtTable::Txt => writeln!(
                text,
                "{time:011.8}  {t1:>6} {t2:>6}  {u:>16.4}  {v:>16.4}  {amplitude:>10.8}  \
                 {phase:>10.4}  {sigma:>10.8}"
            ),
        };
    }
    Ok(text)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub const TXT: &str = "# SRC:M87 DATE(MJD):57853 FREQ:229.0707GHz\n\
        # time(UTC)      T1     T2   U(lambda)        V(lambda)         Iamp(Jy)    Iphase(d)   Isigma(Jy)\n\
        02.15138894      AA     LM   1868288384.0000  -3689129984.0000  0.01103669   -122.7523  0.00446794\n";
    pub const CSV: &str = "#SRC:M87,DATE(MJD):57853,FREQ:229.0707GHz\n\
        #time(UTC),T1,T2,U(lambda),V(lambda),Iamp(Jy),Iphase(d),Isigma(Jy)\n\
        02.15138894,AA,LM,1868288384.0000,-3689129984.0000,0.01103669,-122.7523,0.00446794\n";

    #[test]
    fn exact_both_styles_byte_for_byte() {
        let mut observation = table::parse(TXT).unwrap();
        assert_eq!(to_eht_table(&observation, EhtTable::Txt).unwrap(), TXT);
        assert_eq!(to_eht_table(&observation, EhtTable::Csv).unwrap(), CSV);
        observation.frequency_hz = None;
        let message = to_eht_table(&observation, EhtTable::Csv).unwrap_err().to_string();
        assert!(message.contains("frequency"), "{message}");
    }
}
