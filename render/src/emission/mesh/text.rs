//! Lines of the texts that describe meshes.

use super::MeshError;
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// A statement: a line with those that continue it, without its comment.
pub(super) struct Line<'a> {
    /// Number of its first line, from 1.
    pub number: usize,
    text: Cow<'a, str>,
}

impl Line<'_> {
    /// Its first word.
    pub fn keyword(&self) -> &str {
        self.text.split_whitespace().next().unwrap_or_default()
    }

    /// Returns the text after the first word, up to a comment.
    pub fn rest(&self) -> &str {
        let rest = self.text.split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim());
        // `Material #1` is a name.
        let is_comment = |at: &usize| {
            rest[..*at].ends_with(char::is_whitespace)
                && rest[at + 1..].chars().next().is_none_or(char::is_whitespace)
        };
        let mut comment = rest.match_indices('#').map(|(at, _)| at).filter(is_comment);
        comment.next().map_or(rest, |at| rest[..at].trim())
    }

    /// The words after the first, up to a comment.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.text.split_whitespace().skip(1).take_while(|word| !word.starts_with('#'))
    }

    /// Returns up to so many numbers; those that are not given are `otherwise`.
    pub fn numbers_up_to<const N: usize>(
        &self,
        what: &str,
        count: RangeInclusive<usize>,
        otherwise: [f64; N],
    ) -> Result<[f64; N], MeshError> {
        let (mut numbers, mut given) = (otherwise, 0);
        for word in self.words() {
            let number = word.parse::<f64>();
            let number = number
                .map_err(|_| self.fails(format!("{what}: `{}` is no number", short(word))))?;
            if let Some(place) = numbers.get_mut(given) {
                *place = number;
            }
            given += 1;
        }
        if count.contains(&given) {
            return Ok(numbers);
        }
        let (least, most) = (count.start(), count.end());
        Err(self.fails(format!("{given} {what}: {least} to {most} are allowed")))
    }

    /// An error at this line.
    pub fn fails(&self, why: String) -> MeshError {
        MeshError::Line { line: self.number, why }
    }
}

/// The beginning of a word, for messages.
fn short(word: &str) -> String {
    word.chars().take(40).collect()
}

/// Lines that are neither empty nor comments. A backslash at the end of a line continues it on the next one; a byte order
/// mark is no part of the first.
pub(super) fn lines(bytes: &[u8]) -> Result<impl Iterator<Item = Line<'_>>, MeshError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.contains(&0) {
        return Err(MeshError::Content(
            "not an OBJ file in UTF-8: it holds bytes that are 0".to_owned(),
        ));
    }
    let mut physical = bytes.split(|byte| *byte == b'\n').enumerate();
    Ok(std::iter::from_fn(move || {
        loop {
            let (k, line) = physical.next()?;
            let mut text = String::from_utf8_lossy(line.trim_ascii());
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            while let Some(continued) = text.strip_suffix('\\') {
                let next =
                    physical.next().map(|(_, next)| String::from_utf8_lossy(next.trim_ascii()));
                text = Cow::Owned(format!("{continued} {}", next.unwrap_or_default()));
            }
            return Some(Line { number: k + 1, text });
        }
    }))
}
