//! All integration tests, in one program: they share two cores better than one program after the other, and link once.

mod support;

mod arbitrary_bytes;
mod area_lights;
mod arrays;
mod atlas;
mod chains;
mod cli;
mod containers;
mod dielectric;
mod diffuse;
mod engine_quantities;
mod engines;
mod environment;
mod every_table;
mod families;
mod formats;
mod fresnel;
mod grazing;
mod inputs;
mod judge;
mod kernels;
mod layered;
mod layouts;
mod limits;
mod loaders;
mod malformed_files;
mod materials;
mod models;
mod readme;
mod recognised;
mod shader;
mod verify;
