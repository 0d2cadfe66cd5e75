// Whether the tests are built with AddressSanitizer: GCC defines a macro, clang has a feature.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
#define V3D_ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define V3D_ADDRESS_SANITIZER 1
#endif
#endif
