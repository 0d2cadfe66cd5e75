// A Boost.Beast body that reads a part of a file while it is sent.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/beast/http.hpp>
#include <cstdint>
#include <utility>

#include "daemon/web/web_message.h"

namespace v3d {

// NOLINTBEGIN(readability-identifier-naming): names that Beast requires

/// Meets Beast's Body requirements. If the file has become shorter, the connection ends.
struct FilePartBody {
  using value_type = FilePart;
  static uint64_t size(const FilePart& part) { return static_cast<uint64_t>(part.size); }

  class writer {
   public:
    using const_buffers_type = boost::asio::const_buffer;
    template <bool isRequest, class Fields>
    writer(boost::beast::http::header<isRequest, Fields>& /*header*/, FilePart& part)
        : part_(part) {}
    void init(boost::system::error_code& error) { error = {}; }
    boost::optional<std::pair<const_buffers_type, bool>> get(boost::system::error_code& error) {
      error = {};
      if (part_.size == 0) return boost::none;
      const auto wanted = std::min<int64_t>(part_.size, static_cast<int64_t>(chunk_.size()));
      const ssize_t got =
          pread(part_.file->get(), chunk_.data(), static_cast<size_t>(wanted), part_.first);
      if (got <= 0) {  // an error, or the file was truncated
        error = boost::beast::http::make_error_code(boost::beast::http::error::partial_message);
        return boost::none;
      }
      part_.first += got;
      part_.size -= got;
      return {{const_buffers_type(chunk_.data(), static_cast<size_t>(got)), part_.size > 0}};
    }

   private:
    FilePart& part_;
    std::array<char, 64 << 10> chunk_{};
  };
};

// NOLINTEND(readability-identifier-naming)

}  // namespace v3d
