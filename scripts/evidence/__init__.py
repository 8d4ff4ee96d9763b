"""What scripts/evidence.sh measures and draws."""
