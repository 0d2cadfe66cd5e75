#include <gtest/gtest.h>

#include "daemon/node/node_health.h"
#include "support/temporary_folder.h"

namespace v3d::node {
namespace {

using test::write_text;

/// A machine with two cores, and a process name with spaces and parentheses.
class Machine {
 public:
  Machine() {
    for (const char* folder : {"proc/self", "sys/class/thermal/thermal_zone0",
                               "sys/class/thermal/thermal_zone1", "sys/class/hwmon/hwmon0"}) {
      std::filesystem::create_directories(root_ / folder);
    }
    write_text(root_ / "proc/meminfo", "MemTotal: 4000 kB\nMemAvailable:   1000 kB\n");
    write_text(root_ / "proc/self/status", "Name:\tx\nVmRSS:\t   200 kB\n");
    set_ticks(0, 0, 0);
  }
  /// `busy` and `idle` of all cores together, `daemon` of the process: hundredths of a second.
  void set_ticks(int busy, int idle, int daemon) {
    write_text(root_ / "proc/stat", "cpu  " + std::to_string(busy) + " 0 0 " +
                                        std::to_string(idle) +
                                        " 0 0 0 0 77 0\ncpu0 1 0 0\ncpu1 1 0 0\nintr 5\n");
    write_text(root_ / "proc/self/stat", "7 (a) R (b) S 1 1 1 0 -1 0 0 0 0 0 " +
                                             std::to_string(daemon - daemon / 4) + " " +
                                             std::to_string(daemon / 4) + " 9 9 20 0\n");
  }
  std::map<std::string, double> report() {
    std::map<std::string, double> values;
    health_.report(values);
    return values;
  }
  const test::TemporaryFolder& root() const { return root_; }

 private:
  test::TemporaryFolder root_;
  MachineHealth health_{root_.path()};
};

TEST(MachineHealth, reports_processor_time_since_the_last_call) {
  Machine machine;
  EXPECT_FALSE(machine.report().contains("cpu_machine_percent"));
  machine.set_ticks(150, 50, 100);  // 1 s of two cores; the daemon used one of them
  const auto values = machine.report();
  EXPECT_DOUBLE_EQ(values.at("cpu_machine_percent"), 75);
  EXPECT_DOUBLE_EQ(values.at("cpu_daemon_percent"), 100);
  machine.set_ticks(152, 50, 100);
  EXPECT_DOUBLE_EQ(machine.report().at("cpu_machine_percent"), 75) << "two ticks are too few";
}

TEST(MachineHealth, reports_memory_in_bytes) {
  Machine machine;
  const auto values = machine.report();
  EXPECT_EQ(values.at("memory_daemon_bytes"), 200 * 1024);
  EXPECT_EQ(values.at("memory_available_bytes"), 1000 * 1024);
}

TEST(MachineHealth, reports_the_hottest_zone_or_else_the_hottest_sensor) {
  Machine machine;
  EXPECT_FALSE(machine.report().contains("temperature_max_celsius"));
  write_text(machine.root() / "sys/class/hwmon/hwmon0/temp3_input", "38500\n");
  EXPECT_DOUBLE_EQ(machine.report().at("temperature_max_celsius"), 38.5);
  write_text(machine.root() / "sys/class/thermal/thermal_zone0/temp", "41000\n");
  write_text(machine.root() / "sys/class/thermal/thermal_zone1/temp", "56000\n");
  write_text(machine.root() / "sys/class/thermal/thermal_zone1/trip_point_0_temp", "95000\n");
  EXPECT_DOUBLE_EQ(machine.report().at("temperature_max_celsius"), 56);
}

/// A board with an AMD processor: its only thermal zone is that of ACPI, with a constant.
TEST(MachineHealth, reports_the_processor_that_is_hotter_than_every_zone) {
  Machine machine;
  const auto hwmon = machine.root() / "sys/class/hwmon";
  std::filesystem::create_directories(hwmon / "hwmon1");
  write_text(machine.root() / "sys/class/thermal/thermal_zone0/temp", "16800\n");
  write_text(hwmon / "hwmon0/name", "k10temp\n");
  write_text(hwmon / "hwmon0/temp1_input", "91000\n");
  write_text(hwmon / "hwmon0/temp1_label", "Tctl\n");
  write_text(hwmon / "hwmon1/name", "nct6775\n");
  write_text(hwmon / "hwmon1/temp4_input", "127000\n");
  EXPECT_DOUBLE_EQ(machine.report().at("temperature_max_celsius"), 91);
  write_text(hwmon / "hwmon0/temp2_input", "64000\n");
  write_text(hwmon / "hwmon0/temp2_label", "Tdie\n");
  EXPECT_DOUBLE_EQ(machine.report().at("temperature_max_celsius"), 64) << "Tctl is 27 higher";
}

TEST(MachineHealth, reports_what_the_appliance_counts_and_ignores_other_lines) {
  Machine machine;
  std::filesystem::create_directories(machine.root() / "run/v3d-appliance");
  write_text(machine.root() / "run/v3d-appliance/health",
             "slot_number 2\nslot_trial_flag 0\ncpu_machine_percent 1\nboot_count 12\n"
             "watchdog_resets 1\nunclean_starts 2\ndisk_wear_percent x\nboot_count 99\n");
  const auto values = machine.report();
  EXPECT_EQ(values.at("slot_number"), 2);
  EXPECT_EQ(values.at("slot_trial_flag"), 0);
  EXPECT_EQ(values.at("boot_count"), 12);
  EXPECT_EQ(values.at("watchdog_resets"), 1);
  EXPECT_EQ(values.at("unclean_starts"), 2);
  EXPECT_FALSE(values.contains("cpu_machine_percent")) << "not a value of the appliance";
  EXPECT_FALSE(values.contains("disk_wear_percent")) << "not a number";
}

TEST(ApplianceVersion, is_the_version_of_the_image_and_absent_on_other_machines) {
  const test::TemporaryFolder root;
  std::filesystem::create_directories(root / "etc");
  write_text(root / "etc/os-release", "ID=debian\nIMAGE_VERSION=7\n");
  EXPECT_EQ(version_with_appliance("1.4.0", root.path()), "1.4.0");
  write_text(root / "etc/os-release", "ID=debian\nIMAGE_ID=v3d-appliance\nIMAGE_VERSION=1.4.0-5\n");
  EXPECT_EQ(version_with_appliance("1.4.0", root.path()), "1.4.0+1.4.0-5");
}

TEST(MachineHealth, omits_values_that_it_cannot_read) {
  const test::TemporaryFolder empty;
  MachineHealth health(empty.path());
  std::map<std::string, double> values;
  health.report(values);
  health.report(values);
  EXPECT_TRUE(values.empty());
}

TEST(MachineHealth, reads_this_machine) {
  MachineHealth health;
  std::map<std::string, double> values;
  health.report(values);
  EXPECT_GT(values["memory_daemon_bytes"], 1e5);
  EXPECT_GT(values["memory_available_bytes"], 1e5);
}

}  // namespace
}  // namespace v3d::node
