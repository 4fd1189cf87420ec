/* Told apart by native.py: a library of another version of these functions is not used. */

int itmo_version(void)
{
    return 15;
}
