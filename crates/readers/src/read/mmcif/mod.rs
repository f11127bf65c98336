//! mmCIF files of the Protein Data Bank: the loop `_atom_site`, one or many models.
//!
//! `tokens.rs` splits lines into values. The loop begins with the names of its columns; its rows are values in this
//! order, whatever the line breaks. Lengths are A. After the PDBx/mmCIF dictionary.

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE};
use super::input::TextInput;
use super::sniff::is_text;
use super::text;
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, names};

mod rows;
mod tokens;

use rows::AtomRows;

/// mmCIF files.
pub const FORMAT: Format = Format::new(&MmCif);

struct MmCif;

impl Reader for MmCif {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("mmcif", &["cif", "mmcif"])
    }

    /// Files of the older dictionary, for crystals, begin alike; reading them gives the error.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = text::Lines::new(head, 0..head.len())
            .map(|line| line.text)
            .filter(|line| !line.trim_ascii().is_empty() && !line.starts_with(b"#"));
        let is_cif = is_text(head)
            && lines.next().is_some_and(|line| line.starts_with(b"data_"))
            && lines.any(|line| line.starts_with(b"_"));
        Ok(Confidence::signature_if(is_cif))
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// The names of the columns are before all steps.
    fn reads_steps_alone(&self, head: &[u8]) -> bool {
        AtomRows::find(&mut TextInput::whole(head), MemoryBudget::UNLIMITED).is_ok()
    }

    /// One step for each model, whose atoms are one after another.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let mut steps: Vec<Step> = Vec::new();
        let mut rows = AtomRows::find(text, budget)?;
        let mut model = None;
        // A damaged row ends the last step, and is found again when that is read.
        while let Ok(Some(row)) = rows.next(text) {
            if steps.is_empty() || row.model != model {
                model = row.model;
                if let Some(last) = steps.last_mut() {
                    last.end_at(row.at);
                }
                Step::push(&mut steps, row.at..row.at, budget)?;
                if let Some(step) = steps.last_mut() {
                    step.number = row.model;
                }
            }
        }
        match steps.last_mut() {
            Some(last) => last.end_at(text.at()),
            None => Step::push(&mut steps, 0..text.at(), budget)?,
        }
        Step::keep_increasing_numbers(&mut steps);
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let is_inside = text.at() > 0;
        let mut rows = if is_inside {
            AtomRows::find(&mut TextInput::whole(text.head()), budget)?
        } else {
            AtomRows::find(text, budget)?
        };
        let range = step.byte_range().cloned().unwrap_or_default();
        if is_inside || range.start > text.at() {
            rows.go_to(text, range.start);
        }
        text.end_at(range.end);
        let real = [("occupancy", 1), ("b_factor", 1)];
        let texts = [names::CHAIN, names::RESIDUE_NAME, names::ATOM_NAME];
        let mut atoms = AtomTable::new(&[ELEMENT, RESIDUE], &real, &texts, budget);
        let mut model = None;
        while let Some(row) = rows.next(text)? {
            if *model.get_or_insert(row.model) != row.model {
                break;
            }
            let element = atoms::element(&row.symbol, &row.name, &row.residue_name);
            let whole = [element, row.residue.or(row.label_residue).unwrap_or_default()];
            let real = [row.occupancy.unwrap_or(1.0), row.b_factor.unwrap_or(0.0)];
            let texts = [row.chain(), &row.residue_name, &row.name];
            atoms.push(row.position, &whole, &real, &texts)?;
        }
        let particles = atoms.into_particles();
        Ok(RawParticles { step: step.number, cell: rows.cell(), ..particles })
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![notes::units("angstroms", None, None), notes::cell_note(None)]
    }
}

fn cut_short(at: usize, what: &str) -> ParseError {
    ParseError::malformed(at, format!("{what}: {CUT_SHORT}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{attribute, numbers};
    use crate::read::pieces;

    /// Residues of two atoms whose rows have `columns` with `values`.
    #[track_caller]
    fn residues(columns: &str, values: [&str; 2]) -> Vec<f64> {
        let names: String = ["Cartn_x", "Cartn_y", "Cartn_z"]
            .into_iter()
            .chain(columns.split(' '))
            .map(|name| format!("_atom_site.{name}\n"))
            .collect();
        let rows: String = values.map(|value| format!("1 2 3 {value}\n")).concat();
        let text = format!("data_a\nloop_\n{names}{rows}");
        let steps = pieces::steps(FORMAT, text.as_bytes()).expect("steps");
        let particles = pieces::read(FORMAT, text.as_bytes(), &steps[0]).expect("atoms");
        numbers(&attribute(&particles, "residue").data)
    }

    #[test]
    fn residues_without_a_number_of_the_author_have_that_of_the_label() {
        let both = "auth_seq_id label_seq_id";
        assert_eq!(residues(both, ["7 1", "8 2"]), [7.0, 8.0]);
        assert_eq!(residues("label_seq_id", ["1", "2"]), [1.0, 2.0]);
        assert_eq!(residues(both, ["7 1", "? 2"]), [7.0, 2.0]);
        // Water has neither
        assert_eq!(residues(both, ["7 1", ". ."]), [7.0, 0.0]);
    }
}
