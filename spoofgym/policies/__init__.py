"""Who plays, without torch: scripted, optimal, classical and learned policies. A policy knows no environment."""
