// The format of the pipe between the relay process and the web server.
#include "daemon/viewd/bus_relay.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d::viewd {
namespace {

RelayedMessage heard_number(int n) {
  switch (n % 5) {
    case 0:
      return NotVerified{"there is no key " + std::to_string(n)};
    case 1: {
      wire::MeshMessage mesh;
      mesh.pulse = n;
      mesh.compact.assign(static_cast<size_t>(n), 7);
      return mesh;
    }
    case 2: {
      wire::HealthMessage health;
      health.node = "cap01";
      health.values["frames"] = n;
      return health;
    }
    case 3: {
      wire::EventMessage event;
      event.text = std::to_string(n);
      return event;
    }
    default: {
      wire::PreviewMessage preview;
      preview.camera = "cam01";
      preview.pulse = n;
      preview.size = {4, 3};
      preview.jpeg = {1, 2, 3};
      return preview;
    }
  }
}

std::vector<RelayedMessage> all_of(RelayReader& reader) {
  std::vector<RelayedMessage> all;
  while (auto heard = reader.next()) all.push_back(std::move(*heard));
  return all;
}

RC_GTEST_PROP(BusRelay, relays_every_message_for_any_split_of_the_pipe, ()) {
  std::string bytes;
  const int count = *rc::gen::inRange(1, 30);
  for (int n = 0; n < count; ++n) bytes += encode_record(heard_number(n));
  RelayReader reader;
  for (std::string_view left = bytes; !left.empty();) {
    const auto size = static_cast<size_t>(*rc::gen::inRange(1, 200));
    reader.read(left.substr(0, size));
    left.remove_prefix(std::min(size, left.size()));
  }
  const std::vector<RelayedMessage> told = all_of(reader);
  RC_ASSERT(told.size() == static_cast<size_t>(count));
  for (int n = 0; n < count; ++n) {
    RC_ASSERT(encode_record(told[static_cast<size_t>(n)]) == encode_record(heard_number(n)));
  }
}

TEST(BusRelay, skips_records_that_do_not_decode) {
  RelayReader reader;
  reader.read(std::string("\x01\0\0\0\x09", 5) +
              std::string("\x04\0\0\0\x01"
                          "abc",
                          8) +
              encode_record(heard_number(3)));
  EXPECT_EQ(all_of(reader).size(), 1U);
}

TEST(BusRelay, throws_for_an_invalid_record_size) {
  for (const std::string& odd : {std::string(8, '\0'), std::string(8, '\xff')}) {
    RelayReader reader;
    EXPECT_THROW(reader.read(odd), std::runtime_error);
  }
}

}  // namespace
}  // namespace v3d::viewd
