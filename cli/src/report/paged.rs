//! Tables of so many rows that a browser would take seconds over them: a part stands on the page, a script turns to the
//! others.

use super::Table;
use super::escape::escape;
use serde_json::json;

const SCRIPT: &str = include_str!("assets/rows.js");

/// Rows that stand on the page at a time.
pub const ROWS: usize = 200;

/// Returns whether a table is too long to stand on the page as a whole.
pub fn is_long(table: &Table) -> bool {
    table.rows.len() > ROWS
}

/// The first rows, which `body` has, with all of them for the script.
pub fn wrap(table: &Table, body: &str) -> String {
    // Row by row: as one value, many of them take several times the memory of the page.
    let row = |k: usize, cells: &[String]| {
        let link = table.links.get(k).map_or("", String::as_str);
        json!(std::iter::once(link).chain(cells.iter().map(String::as_str)).collect::<Vec<_>>())
            .to_string()
    };
    let mut data = String::from("{\"rows\":[");
    for (k, cells) in table.rows.iter().enumerate() {
        // Inside a script element nothing may look like its end.
        data += &row(k, cells).replace('<', "\\u003c");
        data.push(if k + 1 < table.rows.len() { ',' } else { ']' });
    }
    data += &format!(",\"step\":{ROWS}}}");
    let (count, title) = (table.rows.len(), escape(&table.title));
    format!(
        "<div class=\"paged\">\n<p class=\"turn\" hidden><label>Rows with <input type=\"search\" aria-label=\"Words that rows of {title} have\"></label> \
         <button type=\"button\">Previous</button> <button type=\"button\">Next</button> <output></output></p>\n\
         <noscript><p>The first {ROWS} of {count} rows; results.csv has all.</p></noscript>\n{body}\
         <script type=\"application/json\">{data}</script>\n</div>\n"
    )
}

/// The script, if any of the tables needs it.
pub fn script<'a>(mut tables: impl Iterator<Item = &'a Table>) -> String {
    if tables.any(is_long) { format!("<script>\n{SCRIPT}</script>\n") } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::super::Report;
    use super::*;

    fn table(rows: usize) -> Table {
        let row = |k: usize| vec![format!("case {k} </script>"), k.to_string()];
        Table {
            title: "All cases".to_owned(),
            caption: String::new(),
            head: ["case", "number"].map(str::to_owned).to_vec(),
            rows: (0..rows).map(row).collect(),
            links: (0..rows).map(|k| format!("cases/{k}")).collect(),
        }
    }

    #[test]
    fn exact_short_tables_are_whole_and_need_no_script() {
        let page = Report { details: vec![table(ROWS)], ..Report::default() }.html().unwrap();
        assert_eq!(page.matches("<tr><th scope=\"row\">").count(), ROWS);
        assert!(!page.contains("<script"));
    }

    #[test]
    fn exact_long_tables_have_every_row_for_the_script() {
        let page = Report { details: vec![table(1000)], ..Report::default() }.html().unwrap();
        assert_eq!(page.matches("<tr><th scope=\"row\">").count(), ROWS);
        let data = page.split_once("application/json\">").unwrap().1;
        let data = data.split_once("</script>").unwrap().0;
        let data: serde_json::Value = serde_json::from_str(data).unwrap();
        assert_eq!(data["rows"].as_array().unwrap().len(), 1000);
        assert_eq!(data["rows"][999], json!(["cases/999", "case 999 </script>", "999"]));
        // That of the data and that of the script itself.
        assert_eq!(page.matches("</script>").count(), 2);
    }
}
