"""Full-waveform inversion: sound speed and attenuation from recorded traces, band by band."""
