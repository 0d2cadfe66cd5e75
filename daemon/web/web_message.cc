#include "daemon/web/web_message.h"

#include <unistd.h>

namespace v3d {

OpenFile::~OpenFile() { close(fd_); }

}  // namespace v3d
