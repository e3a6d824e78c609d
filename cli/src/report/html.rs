//! The page around everything else. All text from outside goes through [`escape`].

use super::escape::escape;
use super::paged;
use super::{Drawing, Figure, LinePlot, Notice, Outcome, Part, Report, Setting, Table, Tone};
use std::fmt::Write;

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");

pub fn page(report: &Report) -> anyhow::Result<String> {
    let sections = [
        report.notice.as_ref().map(notice).unwrap_or_default(),
        summary(&report.summary),
        report.parts.iter().map(part).collect(),
        section("results", "Results", &results(&report.results)),
        section("tables", "Tables", &tables(&report.tables)),
        report.view.as_ref().map(super::View3d::html).transpose()?.unwrap_or_default(),
        section("drawings", "Distributions", &drawings(&report.drawings)),
        section("pictures", "Pictures", &report.figures.iter().map(figure).collect::<String>()),
        section("plots", "Plots", &plots(&report.plots)?),
        section("details", "Details", &tables(&report.details)),
        section("settings", "Settings", &settings(&report.settings)),
        paged::script(report.tables.iter().chain(&report.details)),
    ];
    let parts = [
        ("title", escape(&report.title)),
        ("style", STYLE.to_owned()),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("sections", sections.concat()),
    ];
    Ok(fill(PAGE, &parts))
}

/// Puts parts in the places `{{name}}` of a template, from left to right: what is put in is not looked
/// at again.
pub fn fill(template: &str, parts: &[(&str, String)]) -> String {
    let mut page = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, behind) = after.split_once("}}").unwrap_or((after, ""));
        page.push_str(before);
        let part = parts.iter().find(|(known, _)| *known == name);
        debug_assert!(part.is_some(), "the template asks for {name}");
        page.push_str(part.map_or("", |(_, text)| text.as_str()));
        rest = behind;
    }
    page + rest
}

/// A part of the page with a heading, if there is anything in it.
pub fn section(id: &str, heading: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<section id=\"{id}\">\n<h2>{heading}</h2>\n{content}</section>\n")
}

fn paragraphs(text: &[String]) -> String {
    text.iter().map(|text| format!("<p>{}</p>\n", escape(text))).collect()
}

fn notice(notice: &Notice) -> String {
    let class = match notice.tone {
        Tone::Good => "good",
        Tone::Plain => "plain",
        Tone::Bad => "bad",
    };
    let text = paragraphs(&notice.text);
    let headline = escape(&notice.headline);
    format!(
        "<section id=\"notice\" class=\"{class}\" role=\"note\">\n<p><strong>{headline}</strong></p>\n{text}</section>\n"
    )
}

fn summary(sentences: &[String]) -> String {
    let text = paragraphs(sentences);
    if text.is_empty() { text } else { format!("<section id=\"summary\">\n{text}</section>\n") }
}

fn part(part: &Part) -> String {
    let text = paragraphs(&part.text);
    if text.is_empty() {
        text
    } else {
        format!("<section>\n<h2>{}</h2>\n{text}</section>\n", escape(part.heading))
    }
}

fn tables(all: &[Table]) -> String {
    all.iter().map(one_table).collect()
}

fn one_table(shown: &Table) -> String {
    let head: Vec<String> = shown.head.iter().map(|name| escape(name)).collect();
    let is_long = paged::is_long(shown);
    let there = if is_long { paged::ROWS } else { shown.rows.len() };
    let rows = shown.rows.iter().take(there).enumerate().map(|(k, row)| {
        let mut cells: Vec<String> = row.iter().map(|cell| escape(cell)).collect();
        if let (Some(first), Some(link)) = (cells.first_mut(), shown.links.get(k)) {
            *first = format!("<a href=\"{}\">{first}</a>", escape(link));
        }
        cells
    });
    let (title, caption) = (escape(&shown.title), escape(&shown.caption));
    let body = table(&head, rows);
    let body = if is_long { paged::wrap(shown, &body) } else { body };
    format!("<h3>{title}</h3>\n<p>{caption}</p>\n{body}")
}

fn results(rows: &[Outcome]) -> String {
    let cells =
        |row: &Outcome| [row.name, row.value.as_str(), row.unit, row.meaning].map(escape).to_vec();
    table(&["Quantity", "Value", "Unit", "What it says"].map(str::to_owned), rows.iter().map(cells))
}

fn settings(rows: &[Setting]) -> String {
    let cells =
        |row: &Setting| [&row.key, &row.value, &row.meaning].map(|cell| escape(cell)).to_vec();
    table(&["Setting", "Value", "What it says"].map(str::to_owned), rows.iter().map(cells))
}

/// A table of cells that are safe already; nothing without rows.
fn table(head: &[String], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut body = String::new();
    for cells in rows {
        let [first, rest @ ..] = cells.as_slice() else { continue };
        let rest: String = rest.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        let _ = writeln!(body, "<tr><th scope=\"row\">{first}</th>{rest}</tr>");
    }
    if body.is_empty() {
        return body;
    }
    let head: String = head.iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table></div>\n"
    )
}

fn figure(figure: &Figure) -> String {
    format!(
        "<figure><div class=\"wide\"><img alt=\"{}\" src=\"data:image/png;base64,{}\"></div>\n\
         <figcaption>{}</figcaption></figure>\n",
        escape(&figure.alt),
        base64::encode(&figure.png),
        escape(&figure.caption)
    )
}

/// An SVG with its description and caption.
fn drawing(svg: &str, alt: &str, caption: &str) -> String {
    let (alt, caption) = (escape(alt), escape(caption));
    format!(
        "<figure class=\"plot\"><div class=\"wide\" role=\"img\" aria-label=\"{alt}\">{svg}</div>\n\
         <figcaption>{caption}</figcaption></figure>\n"
    )
}

fn drawings(drawings: &[Drawing]) -> String {
    let one = |(k, Drawing { svg, caption, alt }): (usize, &Drawing)| {
        drawing(&super::plot::inline(svg, &format!("drawing{k}-")), alt, caption)
    };
    drawings.iter().enumerate().map(one).collect()
}

fn plots(plots: &[LinePlot]) -> anyhow::Result<String> {
    let mut all = String::new();
    for (k, plot) in plots.iter().enumerate() {
        let (svg, caption) = plot.draw(&format!("plot{k}-"))?;
        all += &drawing(&svg, &plot.title, &caption);
    }
    Ok(if all.is_empty() { all } else { format!("<div class=\"plots\">\n{all}</div>\n") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_text_is_escaped_and_not_looked_at_twice() {
        assert_eq!(escape("<a href='x'>\"&\""), "&lt;a href=&#39;x&#39;&gt;&quot;&amp;&quot;");
        assert_eq!(escape("\u{1b}[31m\n"), "\\u{1b}[31m\n");
        let parts = [("a", "{{b}}".to_owned()), ("b", "2".to_owned())];
        assert_eq!(fill("1 {{a}} {{b}} }} {", &parts), "1 {{b}} 2 }} {");
    }
}
