"""Drives on an EtherCAT bus: a way to a drive that is plugged into `cosim hardware` by an entry point."""
