# Converts the output of smartctl --json of all disks (slurped) to lines for run/v3d-appliance/health. Wear is the share of
# the rated writes: NVMe reports it; SATA disks report what is left, in the attribute of their vendor.
def wear:
  .nvme_smart_health_information_log.percentage_used
  // ([.ata_smart_attributes.table[]? | select(.id | IN(177, 202, 231, 233)) | 100 - .value] | max);
([.[] | .smart_status.passed | select(. != null)] | select(length > 0) |
  "disk_smart_failed_flag \(if all then 0 else 1 end)"),
([.[] | wear | numbers] | max | numbers | "disk_wear_percent \(.)")
