"""First arrivals: onsets in traces, differences to water, and picks that agree with their neighbours."""
