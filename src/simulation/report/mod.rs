//! What a run leaves behind: the summary, the arrays, the picture and the directory that holds them.

mod arrays;
mod curves;
mod directory;
mod figure;
mod picture;
mod summary;

pub use arrays::final_arrays;
pub use curves::draw_curves;
pub use directory::{RunDirectory, Standing};
pub(crate) use directory::{is_frame, remove, sync_directory, write_file};
pub(crate) use figure::COLOURS;
pub use figure::{Curve, Figure, Scale};
pub(crate) use picture::Sheet;
pub(crate) use picture::{Canvas, moment};
pub use picture::{Picture, draw};
pub(crate) use summary::status;
pub use summary::{Conserved, ErrorNorms, Failed, Parallel, Report, Seconds, Summary, WorkTotal};
