//! The channels of a picture: those that its scene has, or those requested.

use super::RenderError;
use super::channels::{CHANNELS, ChannelKind};
use crate::Error;
use crate::transport::PreparedScene;

/// The channels of a picture of `prepared`: all that it has, or those requested.
pub(super) fn chosen(
    prepared: &PreparedScene,
    refined: bool,
    asked: Option<&[String]>,
) -> Result<Vec<&'static ChannelKind>, Error> {
    let there = |kind: &&ChannelKind| (kind.present)(prepared, refined);
    let all: Vec<&ChannelKind> = CHANNELS.iter().filter(there).collect();
    let Some(asked) = asked else {
        return Ok(all.into_iter().filter(|kind| !kind.is_on_request()).collect());
    };
    if let Some(name) = asked.iter().find(|name| !all.iter().any(|kind| kind.is_meant(name))) {
        let there: Vec<&str> = all.iter().map(|kind| kind.name).collect();
        return Err(RenderError::Channel { name: name.clone(), there: there.join(", ") }.into());
    }
    // In the list's order, each once.
    let is_meant = |kind: &&ChannelKind| asked.iter().any(|name| kind.is_meant(name));
    let chosen: Vec<&ChannelKind> = all.into_iter().filter(is_meant).collect();
    match chosen.iter().find(|kind| kind.is_on_request() && refined) {
        Some(kind) => Err(RenderError::Refined { channel: kind.name }.into()),
        None => Ok(chosen),
    }
}

/// Describes the channels of a picture, for whoever opens its file.
pub(super) fn legend(channels: &[&ChannelKind]) -> String {
    let line = |kind: &&ChannelKind| {
        let unit = if kind.unit.is_empty() { String::new() } else { format!(" ({})", kind.unit) };
        format!("{}{unit}: {}", kind.name, kind.meaning)
    };
    channels.iter().map(line).collect::<Vec<_>>().join(". ")
}
