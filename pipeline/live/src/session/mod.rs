//! Session of viewers in one scene: inputs, the decision about the next picture, and the list of viewers.
//!
//! | module | contents |
//! |---|---|
//! | `stage` | camera, animation and inputs of the controller |
//! | `budget` | budget of light for pictures in motion |
//! | `rest` | refinement of a static view up to the quality of a film, then nothing |
//! | `viewers` | viewers with their queues: the controller steers, the others watch |
//! | `shared` | the session as threads share it |
//! | `studio` | the thread that renders |

mod budget;
mod rest;
mod shared;
mod stage;
mod studio;
mod viewers;

pub use rest::{Rest, RestStep};
pub use shared::{Joined, Refusal, Session, SessionSettings};
pub use stage::LiveStage;
pub use studio::{Studio, record_file};
pub use viewers::{Outgoing, ViewerId};
