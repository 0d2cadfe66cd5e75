// Options of AddressSanitizer and UndefinedBehaviorSanitizer for all test programs, which call
// these functions.
extern "C" {

const char* __asan_default_options();
const char* __ubsan_default_options();

const char* __asan_default_options() {
  return "strict_string_checks=1:detect_stack_use_after_return=1";
}

const char* __ubsan_default_options() { return "print_stacktrace=1"; }

}  // extern "C"
