//! The bytes of a file with several owners, for readers whose libraries need an owner or whose files refer to others.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use spherule_frame::ParseError;

/// Bytes that stay valid as long as a clone exists: a file that is mapped, or in memory.
#[derive(Clone)]
pub struct SharedBytes {
    owner: Arc<dyn AsRef<[u8]> + Send + Sync>,
    siblings: Option<Arc<dyn Siblings>>,
}

/// The files in the directory of a file, and below it.
pub trait Siblings: Send + Sync {
    /// The bytes of the file that is called `name` in the file.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if it is elsewhere or cannot be opened.
    fn open(&self, name: &str) -> Result<SharedBytes, ParseError>;
}

impl SharedBytes {
    /// The bytes of `owner`, which can refer to no other files.
    pub fn new(owner: Arc<dyn AsRef<[u8]> + Send + Sync>) -> Self {
        Self { owner, siblings: None }
    }

    /// The same bytes of a file among `siblings`.
    pub fn among(self, siblings: Arc<dyn Siblings>) -> Self {
        Self { siblings: Some(siblings), ..self }
    }

    /// A copy of `bytes`.
    pub fn copy(bytes: &[u8]) -> Self {
        Self::new(Arc::new(bytes.to_vec()))
    }

    /// The owner of the bytes.
    pub fn owner(&self) -> Arc<dyn AsRef<[u8]> + Send + Sync> {
        Arc::clone(&self.owner)
    }

    /// The bytes of the file beside this one that is called `name` in it.
    ///
    /// # Errors
    /// As [`Siblings::open`]; also if these bytes are not from a file.
    pub fn sibling(&self, name: &str) -> Result<Self, ParseError> {
        match &self.siblings {
            Some(siblings) => siblings.open(name),
            None => Err(ParseError::unsupported(format!(
                "`{name}` cannot be found: these bytes are in memory, not in a file"
            ))),
        }
    }
}

impl Deref for SharedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        (*self.owner).as_ref()
    }
}

impl fmt::Debug for SharedBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}
