"""The chips: tables that read like the datasheet, and behaviour beside their rows."""
