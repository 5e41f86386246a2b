//! Tables, as Markdown and as HTML.

/// A table whose first column says what a row is.
pub struct Grid {
    pub title: String,
    /// One for each column but the first.
    pub headings: Vec<String>,
    pub rows: Vec<(String, Vec<String>)>,
    /// What to know to read it.
    pub note: String,
}

impl Grid {
    pub fn new(title: &str, headings: Vec<String>) -> Self {
        Self { title: title.into(), headings, rows: Vec::new(), note: String::new() }
    }

    pub fn push(&mut self, label: impl Into<String>, cells: impl IntoIterator<Item = String>) {
        self.rows.push((label.into(), cells.into_iter().collect()));
    }

    pub fn markdown(&self) -> String {
        let mut text = format!("**{}**\n\n| | {} |\n", self.title, self.headings.join(" | "));
        text += &format!("|{}\n", " --- |".repeat(self.headings.len() + 1));
        for (label, cells) in &self.rows {
            text += &format!("| {label} | {} |\n", cells.join(" | "));
        }
        if !self.note.is_empty() {
            text += &format!("\n{}\n", self.note);
        }
        text
    }

    pub fn html(&self) -> String {
        let heading = |text: &String| format!("<th scope=\"col\">{}</th>", escaped(text));
        let headings: String = self.headings.iter().map(heading).collect();
        let cell = |text: &String| format!("<td>{}</td>", escaped(text));
        let row = |(label, cells): &(String, Vec<String>)| {
            let cells: String = cells.iter().map(cell).collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", escaped(label))
        };
        let rows: String = self.rows.iter().map(row).collect();
        format!(
            "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\"><table>\n\
             <caption>{title}</caption>\n<thead><tr><td></td>{headings}</tr></thead>\n\
             <tbody>\n{rows}</tbody></table></div>\n<p class=\"note\">{}</p>\n",
            escaped(&self.note),
            title = escaped(&self.title),
        )
    }
}

/// Text as HTML shows it.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
