//! What has been found of the frames of a sequence, so that each question is asked once. Answers belong to one sequence
//! as it was opened: with other parts, another topology or another placement they are others.

use spherule_formats::Sequence;

use super::{RunError, in_thread};
use crate::defaults::Walls;
use crate::survey::{Facts, Question, Survey};

/// Number of surveys that are kept. They are small, but each setting that asks for something new makes one.
const MAX_SURVEYS: usize = 32;

/// See the module.
#[derive(Debug, Default)]
pub struct Findings {
    /// With the parts that are no walls, if there are walls.
    facts: Vec<(Option<Walls>, Facts)>,
    /// With the texts of their questions; the last one is the newest.
    surveys: Vec<(String, Survey)>,
}

impl Findings {
    /// The facts of the particles of `sequence` that are no `walls`.
    pub(super) fn facts(
        &mut self,
        sequence: &mut Sequence,
        walls: Option<&Walls>,
    ) -> Result<&Facts, RunError> {
        let known = self.facts.iter().position(|(of, _)| of.as_ref() == walls);
        let place = match known {
            Some(place) => place,
            None => {
                let facts = match walls {
                    Some(walls) => {
                        sequence.with_parts(&walls.kept, |s| in_thread(|| Facts::of(s)))?
                    }
                    None => in_thread(|| Facts::of(sequence)),
                };
                self.facts.push((walls.cloned(), facts));
                self.facts.len() - 1
            }
        };
        Ok(&self.facts[place].1)
    }

    /// The answers of `sequence` to `question`.
    pub(super) fn survey(
        &mut self,
        sequence: &Sequence,
        question: Question<'_>,
    ) -> Result<Survey, RunError> {
        let text = format!("{question:?}");
        if let Some((_, known)) = self.surveys.iter().find(|(of, _)| *of == text) {
            return Ok(known.clone());
        }
        let survey = in_thread(|| Survey::of(sequence, question))?;
        if self.surveys.len() == MAX_SURVEYS {
            self.surveys.remove(0);
        }
        self.surveys.push((text, survey.clone()));
        Ok(survey)
    }
}
