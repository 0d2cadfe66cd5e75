#include "daemon/kept_order.h"

#include <spdlog/spdlog.h>

#include "base/error.h"
#include "base/file.h"
#include "daemon/take_folder.h"
#include "wire/codec.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// Several nodes may be one PC, and share the folder.
fs::path order_file(const fs::path& take, const std::string& node) {
  return take / (".order-" + node);
}

std::optional<CommandMessage> read_order(const fs::path& file) {
  try {
    const std::string text = read_file(file);
    return decode<CommandMessage>(Bytes(text.begin(), text.end()));
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

void keep_order(const Studio& studio, const std::string& node, const CommandMessage& order) {
  const Bytes bytes = encode(order);
  try {
    replace_file(order_file(take_paths(studio, order.take).folder, node),
                 std::string(bytes.begin(), bytes.end()));
  } catch (const std::exception& error) {
    spdlog::warn("{}", error.what());
  }
}

void drop_order(const Studio& studio, const std::string& node, const std::string& take) {
  std::error_code error;
  fs::remove(order_file(take_paths(studio, take).folder, node), error);
}

std::map<std::string, CommandMessage> kept_orders(const Studio& studio, const std::string& node) {
  std::map<std::string, CommandMessage> orders;
  std::error_code error;
  for (const auto& take : fs::directory_iterator(studio.storage.takes, error)) {
    if (!fs::exists(order_file(take.path(), node), error)) continue;
    const std::string name = take.path().filename().string();
    auto order = read_order(order_file(take.path(), node));
    if (order && order->take == name) orders.emplace(name, std::move(*order));
  }
  return orders;
}

KeptOrders::KeptOrders(const Studio& studio, std::string node)
    : studio_(studio), node_(std::move(node)), orders_(kept_orders(studio, node_)) {}

std::optional<KeptOrders::Found> KeptOrders::running(TrainWatch& train) {
  if (orders_.empty()) return std::nullopt;
  const auto running = train.running();
  if (!running) return std::nullopt;
  const auto found = orders_.find(running->take);
  std::optional<Found> order;
  if (found != orders_.end()) order = {std::move(found->second), running->commanded};
  orders_.clear();
  return order;
}

void KeptOrders::forget() {
  for (const auto& [take, order] : kept_orders(studio_, node_)) drop_order(studio_, node_, take);
  orders_.clear();
}

}  // namespace v3d
