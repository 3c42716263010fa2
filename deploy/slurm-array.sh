#!/usr/bin/env bash
# A run as a Slurm job array: each task computes one shard of the plan in a folder that all nodes share.
# What was not finished continues when this is submitted again.
#SBATCH --job-name=lanesweep
#SBATCH --array=0-19
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=4
#SBATCH --time=02:00:00
#SBATCH --output=lanesweep_%A_%a.log
#SBATCH --open-mode=append
#SBATCH --requeue
#SBATCH --signal=TERM@120
# For a GPU: --gres=gpu:1 here, and --backend gpu below.
out=/shared/result

srun --cpus-per-task="$SLURM_CPUS_PER_TASK" \
  lanesweep study --plan "$out/plan.json" --shard "$SLURM_ARRAY_TASK_ID/20" --out "$out" \
  --threads "$SLURM_CPUS_PER_TASK"
status=$?
# 75: told to end before the time limit; its progress is kept.
if [ "$status" -eq 75 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$status"
