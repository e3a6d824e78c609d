//! Sources by name or by place.

use super::earth::SourcePosition;
use std::str::FromStr;

/// A source by name or by place.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Its name.
    pub name: String,
    /// Position on the sky.
    pub position: SourcePosition,
}

impl FromStr for Source {
    type Err = String;

    /// `sgra`, `m87`, or right ascension in hours and declination in degrees, such as `12.5,-29.25`.
    fn from_str(text: &str) -> Result<Self, String> {
        let named = |name: &str, position| Ok(Source { name: name.to_owned(), position });
        match text.to_ascii_lowercase().as_str() {
            "sgra" | "sgra*" => return named("SGRA", SourcePosition::SGR_A),
            "m87" | "m87*" => return named("M87", SourcePosition::M87),
            _ => {}
        }
        let (ra, dec) = text.split_once(',').ok_or("expected sgra, m87 or RA_HOURS,DEC_DEGREES")?;
        let number = |cell: &str, name: &str| {
            cell.trim().parse::<f64>().map_err(|_| format!("{name} `{cell}` is not a number"))
        };
        let (ra, dec) = (number(ra, "RA")?, number(dec, "Dec")?);
        let position = SourcePosition::new(ra, dec).map_err(|error| error.to_string())?;
        named(&format!("{ra}:{dec}"), position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sources() {
        let source = |text: &str| text.parse::<Source>();
        assert_eq!(source("SgrA").unwrap().position, SourcePosition::SGR_A);
        let place = source("12.5,-29.25").unwrap();
        assert_eq!((place.position.ra_hours, place.position.dec_deg), (12.5, -29.25));
        assert!(source("venus").is_err() && source("25,0").is_err());
    }
}
