#include "daemon/control/take_name.h"

#include "base/core/error.h"
#include "base/core/text.h"
#include "take/take_removal.h"

namespace v3d::control {

void check_take_name(const std::string& take) {
  const std::string cannot = "'" + take + "' cannot name a take: ";
  if (!is_file_name(take)) throw InputError(cannot + std::string(kFileNameRule));
  for (const wire::CommandVerb verb : {wire::CommandVerb::kCheck, wire::CommandVerb::kBackground}) {
    if (take != name(verb)) continue;
    throw InputError(cannot + "the name is reserved for v3dctl " + take + "; choose another");
  }
  if (take == take::kQuarantineFolder) {
    throw InputError(cannot +
                     "the name is reserved for the quarantine of empty takes; choose another");
  }
}

bool records_nothing(const wire::HealthMessage& health) {
  const auto found = health.values.find(kUnrecordedFlag);
  return found != health.values.end() && found->second > 0;
}

}  // namespace v3d::control
