//! FITS headers.

use super::super::FileError;
use super::{BLOCK, CARD};
use std::collections::HashMap;

/// Keywords and values of a header.
#[derive(Debug)]
pub struct Header<'a> {
    /// The text behind `= `, first of each keyword.
    values: HashMap<&'a str, &'a str>,
    /// Texts of the HISTORY cards.
    history: Vec<&'a str>,
    /// Offset in the file.
    offset: usize,
}

impl<'a> Header<'a> {
    /// The header at `offset`, and where its data start.
    pub fn read(bytes: &'a [u8], offset: usize) -> Result<(Self, usize), FileError> {
        let (mut values, mut history) = (HashMap::new(), Vec::new());
        for (index, card) in bytes[offset..].chunks_exact(CARD).enumerate() {
            let at = offset + index * CARD;
            if !card[..8].is_ascii() {
                return Err(FileError::byte(at, "a keyword of a header is not ASCII text"));
            }
            // Comments may hold anything; values that do are not used.
            let text = core::str::from_utf8(card).ok().filter(|text| text.is_ascii());
            let keyword = core::str::from_utf8(&card[..8]).unwrap_or_default().trim_end();
            if index == 0 && keyword != "SIMPLE" && keyword != "XTENSION" {
                return Err(FileError::byte(at, "no FITS header begins here"));
            }
            if keyword == "END" {
                let size = (index + 1) * CARD;
                let end = offset + size.next_multiple_of(BLOCK);
                return if end <= bytes.len() {
                    Ok((Header { values, history, offset }, end))
                } else {
                    Err(FileError::byte(at, "the header's last block is cut off"))
                };
            }
            if let Some(value) = text.and_then(|text| text[8..].strip_prefix("= ")) {
                values.entry(keyword).or_insert(value);
            } else if keyword == "HISTORY" {
                history.extend(core::str::from_utf8(&card[8..]).ok());
            }
        }
        Err(FileError::byte(offset, "the header that begins here has no END"))
    }

    /// Lines of free text about how the file came about, without those by which AIPS tells the order of its rows and the scale of its
    /// weights, which are not those of another file.
    pub fn history(&self) -> Vec<String> {
        let lines = self.history.iter().map(|text| text.replace(char::is_control, " "));
        let lines = lines.map(|line| line.trim().to_owned());
        let is_of_file = |line: &str| {
            let mut words = line.split_whitespace();
            words.next() == Some("AIPS")
                && words
                    .next()
                    .is_some_and(|word| ["SORT", "WTSCAL"].iter().any(|of| word.starts_with(of)))
        };
        lines.filter(|line| !line.is_empty() && !is_of_file(line)).collect()
    }

    fn wrong(&self, keyword: &str, message: impl core::fmt::Display) -> FileError {
        FileError::byte(self.offset, format!("header: {keyword} {message}"))
    }

    /// An error about a keyword's value.
    pub fn error(&self, keyword: &str, message: impl core::fmt::Display) -> FileError {
        let value = self.values.get(keyword).map_or("(missing)", |value| value.trim());
        self.wrong(keyword, format!("= {value} is not allowed: {message}"))
    }

    /// Text in quotes, `''` standing for one, trailing blanks dropped. Control characters, which the standard does not
    /// allow, are blanks.
    pub fn text(&self, keyword: &str) -> Option<String> {
        let value = self.values.get(keyword)?.trim_start().strip_prefix('\'')?;
        let mut text = String::new();
        let mut characters = value.chars().peekable();
        while let Some(c) = characters.next() {
            if c == '\'' && characters.next_if_eq(&'\'').is_none() {
                break;
            }
            text.push(if c.is_control() { ' ' } else { c });
        }
        text.truncate(text.trim_end().len());
        Some(text)
    }

    /// Returns the text before the comment, for values other than text.
    fn plain(&self, keyword: &str) -> Option<&'a str> {
        let value = self.values.get(keyword)?.split('/').next()?.trim();
        (!value.is_empty()).then_some(value)
    }

    /// A finite number, if the keyword is there.
    pub fn number(&self, keyword: &str) -> Result<Option<f64>, FileError> {
        let Some(value) = self.plain(keyword) else { return Ok(None) };
        // Fortran's double precision exponent.
        let parsed = value.replace(['D', 'd'], "E").parse::<f64>();
        match parsed {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(self.error(keyword, "a finite number")),
        }
    }

    /// A finite number; `default` if the keyword is not there.
    pub fn number_or(&self, keyword: &str, default: f64) -> Result<f64, FileError> {
        self.number(keyword).map(|number| number.unwrap_or(default))
    }

    /// A whole number, if the keyword is there.
    pub fn integer(&self, keyword: &str) -> Result<Option<i64>, FileError> {
        match self.plain(keyword).map(str::parse) {
            None => Ok(None),
            Some(Ok(number)) => Ok(Some(number)),
            Some(Err(_)) => Err(self.error(keyword, "a whole number")),
        }
    }

    /// A number of things in `least..=most`.
    pub fn count(&self, keyword: &str, least: usize, most: usize) -> Result<usize, FileError> {
        let Some(count) = self.integer(keyword)? else {
            return Err(self.wrong(keyword, "is missing"));
        };
        match usize::try_from(count) {
            Ok(count) if (least..=most).contains(&count) => Ok(count),
            _ => Err(self.error(keyword, format!("{least} to {most}"))),
        }
    }

    /// Returns whether a logical value is T.
    pub fn is_true(&self, keyword: &str) -> bool {
        self.plain(keyword) == Some("T")
    }

    /// Bytes of a number of the data.
    pub fn number_size(&self) -> Result<usize, FileError> {
        match self.integer("BITPIX")? {
            Some(bits @ (8 | 16 | 32 | 64 | -32 | -64)) => Ok(bits.unsigned_abs() as usize / 8),
            _ => Err(self.error("BITPIX", "8, 16, 32, 64, -32 or -64")),
        }
    }

    /// Refuses coordinates of another equinox than 2000, whose north is another.
    pub fn check_equinox(&self) -> Result<(), FileError> {
        for keyword in ["EQUINOX", "EPOCH"] {
            let value = match self.text(keyword) {
                Some(text) if text.is_empty() => None,
                Some(text) => Some(text.trim_start_matches(['J', 'j']).parse().unwrap_or(f64::NAN)),
                None => self.number(keyword)?,
            };
            // Writers that do not know it write 0.
            if value.is_some_and(|equinox: f64| equinox != 2000.0 && equinox != 0.0) {
                return Err(self.error(keyword, "2000: other equinoxes are not converted"));
            }
        }
        if self.text("RADESYS").is_some_and(|system| system.starts_with("FK4")) {
            return Err(self.error("RADESYS", "ICRS or FK5: FK4 is not converted"));
        }
        Ok(())
    }

    /// Lengths of the axes; the first one of random groups is 0.
    pub fn axes(&self) -> Result<Vec<usize>, FileError> {
        let axes = self.count("NAXIS", 0, 999)?;
        (1..=axes).map(|k| self.count(&format!("NAXIS{k}"), 0, usize::MAX)).collect()
    }

    /// Numbers of the data of one group, its parameters apart.
    pub fn group_size(&self) -> Result<usize, FileError> {
        let axes = self.axes()?;
        let axes = if self.is_true("GROUPS") { axes.get(1..).unwrap_or(&[]) } else { &axes };
        if axes.is_empty() {
            return Ok(0);
        }
        axes.iter()
            .try_fold(1usize, |product, axis| product.checked_mul(*axis))
            .ok_or_else(|| self.error("NAXIS", "axes multiply to more than fits into memory"))
    }

    /// Bytes of the data, padding apart.
    pub fn data_size(&self) -> Result<usize, FileError> {
        let count = |keyword, default| match self.integer(keyword)? {
            None => Ok(default),
            Some(_) => self.count(keyword, 0, usize::MAX),
        };
        let (parameters, groups) = (count("PCOUNT", 0)?, count("GCOUNT", 1)?);
        let numbers = self.group_size()?.checked_add(parameters);
        let number_size = self.number_size()?;
        numbers
            .and_then(|numbers| numbers.checked_mul(groups)?.checked_mul(number_size))
            .ok_or_else(|| self.error("GCOUNT", "sizes multiply to more than fits into memory"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(cards: &[&str]) -> Vec<u8> {
        let mut bytes: Vec<u8> =
            cards.iter().flat_map(|card| format!("{card:<80}").into_bytes()).collect();
        bytes.resize(bytes.len().next_multiple_of(BLOCK), b' ');
        bytes
    }

    #[test]
    fn exact_values_of_every_kind() {
        let bytes = block(&[
            "SIMPLE  =                    T / comment",
            "OBJECT  = 'M''87  ' / a / b",
            "VALUE   =            -1.25D+02 / c",
            "COUNT   =                  17",
            "EMPTY   =",
            "SOURCE  = 'a\u{1b}[31m\nb'",
            "HISTORY  AIPS SORT ORDER='TB'",
            "HISTORY AIPS   SORT ORDER = 'TB'",
            "HISTORY AIPS WTSCAL =  1.0",
            "HISTORY  kerrlight observe",
            "END",
        ]);
        let (header, start) = Header::read(&bytes, 0).unwrap();
        assert_eq!(start, BLOCK);
        assert!(header.is_true("SIMPLE"));
        assert_eq!(header.text("OBJECT").as_deref(), Some("M'87"));
        assert_eq!(header.history(), ["kerrlight observe"]);
        assert_eq!(header.text("SOURCE").as_deref(), Some("a [31m b"));
        assert_eq!(header.number("VALUE"), Ok(Some(-125.0)));
        assert_eq!(header.integer("COUNT"), Ok(Some(17)));
        assert_eq!(header.number("NOTHING"), Ok(None));
        assert!(header.count("COUNT", 0, 16).unwrap_err().to_string().contains("COUNT = 17"));
    }

    #[test]
    fn exact_absurd_sizes_are_errors() {
        let sizes = |cards: &[&str]| {
            let mut all = vec!["SIMPLE  = T", "BITPIX  = -32"];
            all.extend(cards);
            all.push("END");
            let bytes = block(&all);
            Header::read(&bytes, 0).unwrap().0.data_size()
        };
        assert_eq!(sizes(&["NAXIS   = 2", "NAXIS1  = 3", "NAXIS2  = 4"]), Ok(48));
        assert_eq!(sizes(&["NAXIS   = 0"]), Ok(0));
        let huge = "NAXIS1  = 9223372036854775807";
        assert!(sizes(&["NAXIS   = 2", huge, "NAXIS2  = 9"]).is_err());
        assert!(sizes(&["NAXIS   = 1", huge, "GCOUNT  = 3"]).is_err());
        assert!(sizes(&["NAXIS   = 1", "NAXIS1  = -3"]).is_err());
        assert!(sizes(&["NAXIS   = 1"]).is_err());
        assert!(sizes(&["NAXIS   = 1e9"]).is_err());
        for bits in ["0", "x", "nan", "1", "-33"] {
            let bytes = block(&["SIMPLE  = T", &format!("BITPIX  = {bits}"), "NAXIS   = 0", "END"]);
            let message = Header::read(&bytes, 0).unwrap().0.data_size().unwrap_err().to_string();
            assert!(message.contains(&format!("BITPIX = {bits} is not allowed")), "{message}");
        }
    }
}
