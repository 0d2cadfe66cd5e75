// RAII wrappers for Aravis objects (GObject) and errors (GError). For capture/cameras/aravis_*.cc
// only.
#pragma once

#include <arv.h>

#include <memory>
#include <string>

namespace v3d::aravis {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <class T>
using Owned = std::unique_ptr<T, Unref>;

/// The GError of one Aravis call. The destructor frees it.
class Problem {
 public:
  Problem() = default;
  ~Problem() { g_clear_error(&error_); }
  Problem(const Problem&) = delete;
  Problem& operator=(const Problem&) = delete;
  operator GError**() { return &error_; }  // NOLINT(google-explicit-constructor)
  bool happened() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason given"; }

 private:
  GError* error_ = nullptr;
};

/// Reports whether the camera has a GenICam feature. False if the query fails.
inline bool has_feature(ArvCamera* camera, const char* feature) {
  Problem problem;
  return arv_camera_is_feature_available(camera, feature, problem) && !problem.happened();
}

}  // namespace v3d::aravis
