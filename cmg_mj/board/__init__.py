"""The processor in the loop: an exported controller on an emulated Cortex-M7."""
