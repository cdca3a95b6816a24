//! What a report says of itself: document number, dates, operator. Given by whoever signs it, never by the clock.

/// The head of an acceptance report. What is not given has a line to be filled in by hand.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sheet {
    /// Number of the document.
    pub document: Option<String>,
    /// Who ran the test.
    pub operator: Option<String>,
    /// Day of the test.
    pub test_date: Option<String>,
    /// Day of the report.
    pub report_date: Option<String>,
}

impl Sheet {
    /// Name and value of every entry, in the order of the page.
    pub(crate) fn entries(&self) -> [(&'static str, Option<&str>); 4] {
        [
            ("document", self.document.as_deref()),
            ("date of the test", self.test_date.as_deref()),
            ("date of the report", self.report_date.as_deref()),
            ("operator", self.operator.as_deref()),
        ]
    }
}
