/* An empty Python module, so that the library is installed and found as one. */

#define Py_LIMITED_API 0x030b0000
#include <Python.h>

static struct PyModuleDef module = {
    .m_base = PyModuleDef_HEAD_INIT,
    .m_name = "_loops",
    .m_doc = "Compiled loops: see roadeval.kernels.compiled.",
};

PyMODINIT_FUNC PyInit__loops(void)
{
    return PyModule_Create(&module);
}
