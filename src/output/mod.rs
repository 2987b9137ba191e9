//! What a run leaves behind: summary, history, frames, arrays, pictures, checkpoints, and the directory that holds
//! them.

mod arrays;
mod chart;
mod checkpoints;
mod curves;
mod directory;
mod drawing;
mod figure;
mod frames;
mod given;
mod history;
pub mod names;
mod picture;
mod rows;
mod sheet;
mod summary;
mod ticks;
mod vtu;

pub use crate::stopwatch::Spent;
pub use arrays::final_arrays;
pub use checkpoints::CheckpointsAt;
pub(crate) use checkpoints::{Behind, Checkpoints, Resumed};
pub use curves::draw_curves;
pub(crate) use directory::write_file;
pub use directory::{RunDirectory, Standing};
pub use drawing::draw;
pub(crate) use drawing::svg;
pub(crate) use figure::COLOURS;
pub use figure::{Curve, Figure, Scale};
pub use frames::{Frames, FramesAt};
pub use given::{GivenMesh, read_mesh};
pub use history::History;
pub(crate) use picture::Canvas;
pub use picture::Picture;
pub(crate) use rows::Rows;
pub use summary::{Ended, Failed, Figures, Parallel, Summary};
pub(crate) use ticks::moment;
pub(crate) use vtu::structured;
