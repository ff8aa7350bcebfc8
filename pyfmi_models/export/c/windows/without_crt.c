/* What a Windows library needs where no MinGW runtime is linked: everything else comes from Windows' own UCRT.
 * Building the MinGW runtime takes 1.5 minutes; an FMU uses none of it. No part of the sources in an archive.
 */
#include <stdarg.h>
#include <stddef.h>

int __stdio_common_vsprintf(unsigned long long options, char *buffer, size_t size, const char *format, void *locale,
                            va_list arguments);

static const unsigned long long standard_behaviour = 2; /* _CRT_INTERNAL_PRINTF_STANDARD_SNPRINTF_BEHAVIOR */

int vsnprintf(char *buffer, size_t size, const char *format, va_list arguments) {
    return __stdio_common_vsprintf(standard_behaviour, buffer, size, format, NULL, arguments);
}

int snprintf(char *buffer, size_t size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(buffer, size, format, arguments);
    va_end(arguments);
    return length;
}

/* Where Windows enters the library: there is nothing to set up. */
int DllMainCRTStartup(void *module, unsigned long reason, void *reserved) {
    (void)module;
    (void)reason;
    (void)reserved;
    return 1;
}

/* Names that the linker of zig before 0.17 asks for. */
unsigned _tls_index;

int _DllMainCRTStartup(void *module, unsigned long reason, void *reserved) {
    return DllMainCRTStartup(module, reason, reserved);
}
