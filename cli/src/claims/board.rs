//! What one look at the claims of a folder tells.

use super::CLAIMS;
use std::collections::HashMap;
use std::path::Path;

/// How it stands with one piece.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Piece {
    /// How often it was taken.
    pub turns: u32,
    /// Of these, up to which time it was given back.
    freed: u32,
    /// Whether it is done.
    pub done: bool,
    /// Whether it failed.
    pub failed: bool,
}

impl Piece {
    /// Whether it is neither done nor failed.
    pub fn is_open(&self) -> bool {
        !self.done && !self.failed
    }

    /// Whether nobody has it.
    pub fn is_free(&self) -> bool {
        self.is_open() && self.freed == self.turns
    }
}

/// All pieces that were ever taken. Another process may have taken more since.
#[derive(Debug, Default)]
pub struct Board(HashMap<String, Piece>);

impl Board {
    /// Reads the claims of a shared folder; nothing if there are none.
    pub fn read(folder: &Path) -> std::io::Result<Self> {
        let mut board = Board::default();
        let entries = match std::fs::read_dir(folder.join(CLAIMS)) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(board),
            Err(error) => return Err(error),
        };
        for entry in entries {
            if let Some(name) = entry?.file_name().to_str() {
                board.add(name);
            }
        }
        Ok(board)
    }

    /// How it stands with a piece.
    pub fn of(&self, piece: &str) -> Piece {
        self.0.get(piece).copied().unwrap_or_default()
    }

    /// A name among the claims.
    pub fn add(&mut self, name: &str) {
        let numbered = |name: &str| {
            let (piece, turn) = name.rsplit_once('.')?;
            Some((piece.to_owned(), turn.parse::<u32>().ok()?.checked_add(1)?))
        };
        if let Some(piece) = name.strip_suffix(".done") {
            self.entry(piece).done = true;
        } else if let Some(piece) = name.strip_suffix(".failed") {
            self.entry(piece).failed = true;
        } else if let Some((piece, turn)) = name.strip_suffix(".free").and_then(numbered) {
            let piece = self.entry(&piece);
            piece.freed = piece.freed.max(turn);
            piece.turns = piece.turns.max(turn);
        } else if let Some((piece, turn)) = numbered(name) {
            let piece = self.entry(&piece);
            piece.turns = piece.turns.max(turn);
        }
    }

    fn entry(&mut self, piece: &str) -> &mut Piece {
        self.0.entry(piece.to_owned()).or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_names_tell_how_pieces_stand() {
        let mut board = Board::default();
        let names = ["a.0", "b.0", "b.0.free", "c.1", "c.0", "c.done", "d_0.5.0", "d_0.5.failed"];
        names.iter().for_each(|name| board.add(name));
        let (a, b, c, d) = (board.of("a"), board.of("b"), board.of("c"), board.of("d_0.5"));
        assert!(a.is_open() && !a.is_free() && a.turns == 1);
        assert!(b.is_free() && b.turns == 1);
        assert!(c.done && !c.is_free() && c.turns == 2);
        assert!(d.failed && !d.is_open());
        assert!(board.of("e").is_free() && board.of("e").turns == 0);
        board.add("b.1");
        assert!(!board.of("b").is_free());
    }
}
