//! A report as one HTML file: without external resources, readable on a phone, in light and dark mode. Only pages that
//! add a script have one.
//! External text (file names, messages) is escaped here and nowhere else.

use std::fmt::Write as _;

use super::escape::escaped;
use super::plots::{self, Plot};

/// A table: headings, then rows. Cells are plain text.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    id: String,
    heads: Vec<String>,
    rows: Vec<Row>,
}

/// A row of a table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Row {
    class: Option<&'static str>,
    cells: Vec<String>,
}

impl Table {
    /// An empty table with a column for each of `heads`. Columns with only numbers are aligned to the right.
    pub fn new(id: &str, heads: &[&str]) -> Self {
        Self {
            id: id.to_owned(),
            heads: heads.iter().map(|&head| head.to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; missing cells are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(Row { class: None, cells: cells.into_iter().collect() });
    }

    /// Adds a highlighted row for a failure.
    pub fn bad_row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(Row { class: Some("bad"), cells: cells.into_iter().collect() });
    }

    /// Whether there are no rows.
    pub const fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.cells.get(column));
        cells.all(|cell| !cell.chars().any(char::is_alphabetic) && cell.len() < 24)
    }

    fn html(&self) -> String {
        let columns: Vec<&str> = (0..self.heads.len())
            .map(|i| if self.is_numeric(i) { " class=\"number\"" } else { "" })
            .collect();
        let mut html = format!(
            "<div class=\"wide\" tabindex=\"0\">\n<table id=\"{}\">\n<thead><tr>",
            escaped(&self.id)
        );
        for (head, class) in self.heads.iter().zip(&columns) {
            html += &format!("<th scope=\"col\"{class}>{}</th>", escaped(head));
        }
        html += "</tr></thead>\n<tbody>\n";
        for row in &self.rows {
            html += &row.class.map_or_else(|| "<tr>".to_owned(), |c| format!("<tr class=\"{c}\">"));
            let blank = String::new();
            let cells = row.cells.iter().chain(std::iter::repeat(&blank));
            for (cell, class) in cells.zip(&columns) {
                html += &format!("<td{class}>{}</td>", escaped(cell));
            }
            html += "</tr>\n";
        }
        html + "</tbody>\n</table>\n</div>\n"
    }
}

/// A page under construction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    title: String,
    body: String,
    /// Style rules besides [`CSS`].
    style: &'static str,
    script: Option<Script>,
}

/// A script, and what a page with it may load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Script {
    code: &'static str,
    /// Sources of images, as in a Content-Security-Policy.
    images: &'static str,
}

impl Page {
    /// A page with its title as the first heading.
    pub fn new(title: &str) -> Self {
        Self {
            title: title.to_owned(),
            body: format!("<h1>{}</h1>\n", escaped(title)),
            style: "",
            script: None,
        }
    }

    /// Adds HTML as it is: no external text.
    pub fn markup(&mut self, html: &'static str) {
        self.body += html;
    }

    /// Adds data for a script, as JSON in an element that is not shown.
    pub fn data(&mut self, id: &str, data: &serde_json::Value) {
        // Strings of JSON may contain any text, but nothing that ends the element
        let json = data.to_string().replace('<', "\\u003c");
        let id = escaped(id);
        self.put(format_args!("<script type=\"application/json\" id=\"{id}\">{json}</script>\n"));
    }

    /// Sets additional style rules.
    pub fn style(&mut self, css: &'static str) {
        self.style = css;
    }

    /// Sets the script, which runs when the page is complete, and the sources from which the page may load images
    /// (besides data in it), as in a Content-Security-Policy.
    pub fn script(&mut self, code: &'static str, images: &'static str) {
        self.script = Some(Script { code, images });
    }

    /// Begins a section; `id` is a link target.
    pub fn section(&mut self, id: &str, heading: &str) {
        self.put(format_args!("<h2 id=\"{}\">{}</h2>\n", escaped(id), escaped(heading)));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: &str) {
        self.put(format_args!("<p>{}</p>\n", escaped(text)));
    }

    /// Adds a paragraph about a failure.
    pub fn warning(&mut self, text: &str) {
        self.put(format_args!("<p class=\"warning\">{}</p>\n", escaped(text)));
    }

    /// Adds a paragraph that ends with a link to a file next to the page.
    pub fn link(&mut self, text: &str, file: &str) {
        self.put(format_args!(
            "<p>{} <a href=\"./{file}\">{file}</a>.</p>\n",
            escaped(text),
            file = escaped(file)
        ));
    }

    /// Adds names and values.
    pub fn key_values(&mut self, pairs: &[(&str, String)]) {
        self.body += "<dl>\n";
        for (key, value) in pairs {
            self.put(format_args!(
                "<div><dt>{}</dt><dd>{}</dd></div>\n",
                escaped(key),
                escaped(value)
            ));
        }
        self.body += "</dl>\n";
    }

    /// Adds a table in a box that scrolls horizontally if the table is too wide.
    pub fn table(&mut self, table: &Table) {
        self.body += &table.html();
    }

    /// Adds plots, side by side if they fit.
    pub fn plots(&mut self, plots: &[Plot]) {
        self.body += "<div class=\"plots\">\n";
        for plot in plots {
            self.body += &plot.figure();
        }
        self.body += "</div>\n";
    }

    /// Begins a collapsed part.
    pub fn fold(&mut self, heading: &str) {
        self.put(format_args!("<details>\n<summary>{}</summary>\n", escaped(heading)));
    }

    /// Ends the collapsed part.
    pub fn end_fold(&mut self) {
        self.body += "</details>\n";
    }

    /// The whole file.
    pub fn html(&self) -> String {
        let script = self.script.map(|s| format!("<script>\n{}</script>\n", s.code));
        let policy = self.script.map(|s| format!(" {}; script-src 'unsafe-inline'", s.images));
        // The empty icon prevents browsers from requesting one from a server.
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" \
             content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:{}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <link rel=\"icon\" href=\"data:,\">\n\
             <title>{}</title>\n<style>\n{CSS}{}{}</style>\n</head>\n<body>\n<main>\n{}</main>\n{}</body>\n</html>\n",
            policy.unwrap_or_default(),
            escaped(&self.title),
            plots::CSS,
            self.style,
            self.body,
            script.unwrap_or_default()
        )
    }

    fn put(&mut self, html: std::fmt::Arguments) {
        self.body.write_fmt(html).expect("a string takes everything");
    }
}

const CSS: &str = "\
:root{--page:#ffffff;--ink:#1b1b1b;--faint:#5c5c5c;--grid:#d9d9d9;--band:#f4f4f4;--bad:#a3170f;--badband:#fdecea;--link:#005a9c}
@media (prefers-color-scheme:dark){
:root{--page:#16181b;--ink:#e6e6e6;--faint:#a3a7ad;--grid:#3a3e44;--band:#1f2226;--bad:#ff9d94;--badband:#3a1d1b;--link:#7cc0ff}
}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.45 system-ui,sans-serif;-webkit-text-size-adjust:100%}
main{max-width:72rem;margin:0 auto;padding:1rem}
h1{font-size:1.6rem;line-height:1.2;margin:.5rem 0 1rem;overflow-wrap:anywhere}
h2{font-size:1.2rem;margin:2.2rem 0 .7rem;padding-top:.7rem;border-top:1px solid var(--grid)}
p{margin:.5rem 0;max-width:46rem;overflow-wrap:anywhere}
a{color:var(--link)}
.warning{color:var(--bad);font-weight:600}
dl{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,10rem),1fr));gap:.6rem 1.2rem;margin:.5rem 0}
dl div{min-width:0}
dt{color:var(--faint);font-size:.85rem}
dd{margin:0;overflow-wrap:anywhere;unicode-bidi:isolate;font-variant-numeric:tabular-nums}
.wide{overflow-x:auto;border:1px solid var(--grid);border-radius:6px;margin:.6rem 0}
table{border-collapse:collapse;width:100%;font-size:.85rem;font-variant-numeric:tabular-nums}
th,td{padding:.35rem .5rem;text-align:left;vertical-align:top;unicode-bidi:isolate}
th{vertical-align:bottom;background:var(--band);font-weight:600;white-space:pre-line}
td{border-top:1px solid var(--grid);overflow-wrap:break-word;max-width:40rem}
.number{text-align:right;white-space:nowrap}
th.number{white-space:pre-line}
tr.bad td{background:var(--badband);color:var(--bad)}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:1.8rem 2.2rem;margin:.8rem 0}
.plots figure{max-width:38rem}
summary{cursor:pointer;padding:.3rem 0;color:var(--link)}
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn external_text_is_escaped() {
        let hostile = "<script>alert('a&b')</script>\"\u{202e}\u{0}\u{7f}";
        assert_eq!(
            escaped(hostile),
            "&lt;script&gt;alert(&#39;a&amp;b&#39;)&lt;/script&gt;&quot;\\u{202e}\\u{0}\\u{7f}"
        );
        assert_eq!(escaped("Wasser \u{e4} 水\n"), "Wasser \u{e4} 水\n");

        let mut table = Table::new(hostile, &[hostile]);
        table.bad_row([hostile.to_owned()]);
        let mut page = Page::new(hostile);
        page.section(hostile, hostile);
        page.text(hostile);
        page.warning(hostile);
        page.link(hostile, hostile);
        page.key_values(&[(hostile, hostile.to_owned())]);
        page.table(&table);
        page.fold(hostile);
        page.end_fold();
        let html = page.html();
        assert!(!html.contains("<script") && !html.contains('\u{202e}') && !html.contains('\u{0}'));
        // The text does not end an attribute anywhere.
        assert!(!html.contains("script>\"") && !html.contains("alert('"));
        assert_eq!(html.matches("&lt;script&gt;").count(), 15);
    }

    #[test]
    fn pages_load_no_external_resources() {
        let html = Page::new("a page").html();
        assert!(!html.contains("http://") && !html.contains("https://"));
        assert!(!html.contains("<script") && !html.contains("@import") && !html.contains("url("));
    }

    #[test]
    fn data_of_scripts_cannot_end_their_element() {
        let hostile = serde_json::json!({"name": "</script><script>alert(1)</script><!--"});
        let mut page = Page::new("a page");
        page.data("data", &hostile);
        page.script("run();\n", "'self'");
        let html = page.html();
        assert_eq!(html.matches("<script").count(), 2);
        assert!(html.contains("<script>\nrun();\n</script>") && !html.contains("<!--"));
        assert!(html.contains("img-src data: 'self'; script-src 'unsafe-inline'\">"));
        let (_, after) = html.split_once("id=\"data\">").unwrap();
        let (json, _) = after.split_once("</script>").unwrap();
        assert_eq!(serde_json::from_str::<serde_json::Value>(json).unwrap(), hostile);
    }

    #[test]
    fn columns_of_numbers_are_right_aligned() {
        let mut table = Table::new("t", &["name", "count"]);
        table.row(["a".to_owned(), "1 000".to_owned()]);
        table.row(["b".to_owned()]);
        let html = table.html();
        assert!(
            html.contains("<th scope=\"col\">name</th><th scope=\"col\" class=\"number\">count")
        );
        assert!(html.contains("<td>b</td><td class=\"number\"></td></tr>"));
    }
}
