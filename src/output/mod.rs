//! What a run leaves behind: summary, history, frames, arrays, pictures, checkpoints, and the directory that holds them.

mod arrays;
mod checkpoints;
mod curves;
mod directory;
mod figure;
mod frames;
mod history;
mod picture;
mod rows;
mod summary;
pub(crate) mod vtu;

pub use arrays::final_arrays;
pub(crate) use checkpoints::Checkpoints;
pub use checkpoints::CheckpointsAt;
pub use curves::draw_curves;
pub(crate) use directory::write_file;
pub use directory::{RunDirectory, Standing};
pub(crate) use figure::COLOURS;
pub use figure::{Curve, Figure, Scale};
pub(crate) use frames::frame_name;
pub use frames::{Frames, FramesAt};
pub use history::History;
pub(crate) use picture::{Canvas, Sheet, moment};
pub use picture::{Picture, draw};
pub(crate) use rows::Rows;
pub(crate) use summary::status;
pub use summary::{Failed, Parallel, Summary};
