//! The program as its users meet it, the book, and the repository itself.

mod adding_a_model;
mod book;
mod check;
mod command_line;
mod configuration;
mod console;
mod figures;
mod help_examples;
mod report_page;
mod report_width;
mod source_rules;
#[cfg(not(feature = "gpu"))]
mod without_gpu;
