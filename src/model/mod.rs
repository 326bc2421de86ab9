//! Light scattering models.
