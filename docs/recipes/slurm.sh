#!/bin/bash
# Ages the models that a list names, one a task: sbatch --array=1-$(wc -l < models.txt) slurm.sh models.txt
#SBATCH --job-name=weathercoat
#SBATCH --cpus-per-task=1
#SBATCH --mem=1G
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%A_%a.log

set -euo pipefail
model=$(sed -n "${SLURM_ARRAY_TASK_ID}p" "$1")
name=$(basename "${model%.*}")
mkdir -p aged

# as a step, so that it hears SIGTERM before the time limit and keeps its state
srun weathercoat run standard "$model" -o "aged/$name" --resume --threads "$SLURM_CPUS_PER_TASK" --quiet
