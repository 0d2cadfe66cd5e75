# Converts the output of smartctl --json of all disks (slurped) to lines for run/v3d-appliance/health. Wear is the share of
# the rated writes: NVMe reports it; SATA disks report what is left, in the attribute of their vendor. Of several attributes, the
# first of this order counts: on disks with 231 (life left), 177 and 233 may have another meaning.
def wear:
  .nvme_smart_health_information_log.percentage_used
  // ([.ata_smart_attributes.table[]?] as $table
      | first((231, 202, 177, 233) as $id | $table[] | select(.id == $id) | 100 - .value));
([.[] | .smart_status.passed | select(. != null)] | select(length > 0) |
  "disk_smart_failed_flag \(if all then 0 else 1 end)"),
([.[] | wear | numbers] | max | numbers | "disk_wear_percent \(.)")
