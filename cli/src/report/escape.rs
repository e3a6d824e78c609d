//! Text from outside on its way into a page.

/// Text as it may stand between tags and in quoted attributes.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // HTML has no other control characters.
            _ if letter.is_control() && !letter.is_ascii_whitespace() => {
                safe.extend(letter.escape_default());
            }
            _ => safe.push(letter),
        }
    }
    safe
}
